"""Very long records: fits, smoothing and search work on an excerpt, and the whole record judges what they find.

An excerpt is pieces of the record, each a run with a first state of its own: most are evenly spread, the others are
those where the model fails most in a simulation of all samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.discovery.fit import Hypothesis, homotopy, prepare
from suite.discovery.whole import PIECE, Survey, pieces, survey
from suite.model import Model
from suite.record import Record, Whole

Indices = npt.NDArray[np.int64]

LONGEST = 131_072  # samples up to which a record is fitted whole
PIECES, FEWEST = 32, 6  # of an excerpt; fewer where each brings many first states
STATES = 128  # first states of all pieces together, about
WORST = 4  # one piece of so many is there because the model fails in it
SKETCH = 1024  # samples of each piece that the model is fitted to before it is known where it fails


def excerpt(model: Model, record: Record, longest: int = LONGEST, length: int = PIECE) -> Record:
    """The record itself up to `longest` samples; of a longer one an excerpt, whose `whole` is the record.

    The model's parameters are fitted to short pieces of it first (fixed ones stay): where it fails is then a matter of
    its equations. The last piece, which is held out of fits, is one in which it fails.
    """
    if len(record) <= longest or record.whole is not None:
        return record
    first, last = pieces(record, length)
    count = min(len(first), int(np.clip(STATES // len(model.states), FEWEST, PIECES)))
    spread = np.unique(np.linspace(0, len(first) - 1, count - count // WORST).round().astype(np.int64))
    sketch = cut(record, first[spread], np.minimum(last[spread], first[spread] + SKETCH), SKETCH)
    problem = prepare(model, sketch)
    base = homotopy(problem, problem.start)
    q = 0.0 if follows(base, len(sketch.starts)) else base.best.q
    level = base.exact if q == 0.0 else base.best
    order = _failing(survey(problem, level.point.p, (), record, q, length))
    worst = [k for k in order.tolist() if k not in spread][: count - len(spread)]
    # The one in which it fails most is fitted, the next is held out.
    ranked = [*spread.tolist(), *worst[:1], *worst[2:], *worst[1:2]]
    return cut(record, first[ranked], last[ranked], length)


def follows(base: Hypothesis, runs: int) -> bool:
    """Whether the exact simulation stays finite over runs that need not be cut further."""
    return base.exact.passed.finite and np.isfinite(base.exact.L) and len(base.exact.point.x0) == runs


def cut(record: Record, first: Indices, last: Indices, length: int) -> Record:
    """Pieces of a record as its runs, in this order; `last` are one past the last samples."""
    rows = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])
    starts = np.concatenate([[0], np.cumsum(last - first)[:-1]])
    home = np.searchsorted(record.bounds, first, side="right") - 1
    known = record.names if len(record.names) == len(record.starts) else (record.source,) * len(record.starts)
    names = tuple(f"{known[r]}, from t = {record.t[a]:.6g}" for r, a in zip(home, first, strict=True))
    return replace(
        record, t=record.t[rows], u=record.u[rows], y=record.y[rows], starts=tuple(starts.tolist()), names=names,
        whole=Whole(record, tuple(first.tolist()), length),
    )  # fmt: skip


def _failing(found: Survey) -> Indices:
    """The pieces by falling error, those with few measurements left out."""
    said = found.count > 0.5 * np.median(found.count)
    return np.argsort(np.where(said, -found.square, np.inf), kind="stable")[: int(said.sum())]
