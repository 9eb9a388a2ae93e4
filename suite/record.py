"""Record: what was measured. Time, inputs, outputs (NaN is missing), one or several runs of the same plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from suite.errors import DataError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """What an estimator may know beside the model and the record.

    x0 (n,) and P0 (n, n): the first state and its covariance (0 where known). R (outputs,): variance of one sample.
    Q (n,): default density of the model error, in (rate unit)^2 * time; 0 for equations that are definitions.
    """

    x0: Array
    P0: Array
    R: Array
    Q: Array


@dataclass(frozen=True)
class Record:
    """Measurements on a time axis of their own: t (N,), u (N, inputs), y (N, outputs), NaN in y where missing.

    `starts` are the first samples of the runs, `names` their names (none, or one a run); within a run time increases.
    `whole` is there in an excerpt of a very long record. There is no field for the truth, so no estimator can see it.
    Raises DataError where shapes disagree, time does not increase, or a run has one sample.
    """

    t: Array
    u: Array
    y: Array
    starts: tuple[int, ...] = (0,)
    names: tuple[str, ...] = ()
    prior: Prior | None = None
    source: str = field(default="record", compare=False)
    whole: Whole | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("t", "u", "y"):
            # The kernels take contiguous writable numbers; a column of a table may be neither.
            object.__setattr__(self, name, np.require(getattr(self, name), np.float64, ["C", "W"]))
        N = len(self.t)
        if self.u.ndim != 2 or self.y.ndim != 2 or len(self.u) != N or len(self.y) != N:
            shapes = f"t {self.t.shape}, u {self.u.shape}, y {self.y.shape}"
            raise DataError(f"{self.source}: expected t (N,), u (N, inputs), y (N, outputs), got {shapes}; align them")
        for first, last in self._spans:
            if last - first < 2:
                raise DataError(f"{self.source}: a run has {last - first} sample(s), at least 2 are needed; add rows")
            steps = np.diff(self.t[first:last])
            if not np.all(steps > 0):
                at = first + int(np.argmin(steps > 0)) + 1
                raise DataError(
                    f"{self.source}: time does not increase at sample {at} "
                    f"(t = {self.t[at]:g} after {self.t[at - 1]:g}); sort the rows or start a new run"
                )

    @property
    def _spans(self) -> list[tuple[int, int]]:
        return list(zip(self.starts, (*self.starts[1:], len(self.t)), strict=True))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def dt(self) -> Array:
        """Steps between samples of a single run, (N - 1,)."""
        return np.diff(self.t)

    @property
    def bounds(self) -> npt.NDArray[np.int64]:
        """First sample of each run, and N: (runs + 1,)."""
        return np.array([*self.starts, len(self.t)], dtype=np.int64)

    @property
    def runs(self) -> tuple[Record, ...]:
        """The runs, each as a record of its own."""
        names = self.names if len(self.names) == len(self.starts) else (self.source,) * len(self.starts)
        return tuple(
            replace(self.part(first, last), names=(name,), source=name)
            for (first, last), name in zip(self._spans, names, strict=True)
        )

    def part(self, first: int, last: int) -> Record:
        """Samples first..last-1 of one run, as a record of its own."""
        cut = slice(first, last)
        return replace(self, t=self.t[cut], u=self.u[cut], y=self.y[cut], starts=(0,))

    def with_prior(self, prior: Prior) -> Record:
        """The same measurements with what an estimator may know."""
        return replace(self, prior=prior)


@dataclass(frozen=True)
class Whole:
    """What an excerpt was cut from: the record, the samples there at which the pieces begin, and the pieces' usual
    length; the pieces are the excerpt's runs until a plant that forgets its start has them cut further.
    """

    record: Record
    first: tuple[int, ...]
    length: int


def join(records: Sequence[Record]) -> Record:
    """Several runs of the same plant as one record."""
    if len(records) == 1:
        return records[0]
    lengths = np.cumsum([0] + [len(record) for record in records])
    starts = tuple(int(at + s) for record, at in zip(records, lengths, strict=False) for s in record.starts)
    return replace(
        records[0],
        t=np.concatenate([record.t for record in records]),
        u=np.concatenate([record.u for record in records]),
        y=np.concatenate([record.y for record in records]),
        starts=starts,
        names=tuple(name for record in records for name in record.names),
        source=", ".join(dict.fromkeys(record.source for record in records)),
    )
