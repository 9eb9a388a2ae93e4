"""Measured records that are not ours to ship: found in a folder the user has, checked, and read."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from suite.errors import DataError
from suite.record import Record, join


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


def read_runs(source: Source, folder: Path | None, time: str, columns: Sequence[str]) -> Record:
    """One run a CSV file: the column `time`, and `columns` as outputs; no inputs."""
    import pandas as pd

    runs = []
    for path in source.paths(folder):
        table = pd.read_csv(path)
        t, y = table[time].to_numpy(np.float64), table[list(columns)].to_numpy(np.float64)
        runs.append(Record(t, np.zeros((len(t), 0)), y, names=(path.stem,), source=path.name))
    return join(runs)
