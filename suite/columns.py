"""A table of measured columns, however its file holds it, and what a column may be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from suite.errors import DataError

Array = npt.NDArray[np.float64]

# Numbers taken from one file at most, 0.8 GB of them. Of a compressed file of any size this bounds what it expands to.
MOST = 100_000_000


@dataclass(frozen=True)
class Table:
    """A file's columns by name; `read` gets some of them as (N,) floats, NaN where empty, `place` names a row."""

    file: str
    columns: tuple[str, ...]
    read: Callable[[Sequence[str]], dict[str, Array]]
    place: Callable[[int], str]


def refuse_many(file: str, rows: int, columns: int) -> None:
    """Refuse before memory is spent what would not fit into it."""
    if rows * columns > MOST:
        raise DataError(
            f"{file}: {rows} rows of {columns} columns are more than the {MOST} numbers that are read of a file; "
            "split it into several, or keep fewer samples"
        )


def floats(file: str, name: str, column: npt.NDArray[np.generic]) -> Array:
    """A column (N,) of any type as numbers."""
    if column.dtype.kind in "biuf":
        return column.astype(np.float64)
    if column.dtype.kind in "Mm":
        raise DataError(f"{file}, column {name}: holds dates; convert them to seconds from the start")
    if column.dtype.kind == "c":
        raise DataError(f"{file}, column {name}: holds complex numbers; save their parts as columns")
    values = np.empty(len(column))
    for row, cell in enumerate(column.tolist()):
        try:
            values[row] = np.nan if cell is None else float(cell)
        except (TypeError, ValueError, OverflowError):
            raise DataError(
                f"{file}, row {row + 1}, column {name}: expected a number, got {repr(cell)[:40]}; "
                "correct it, or leave the cell empty if it is missing"
            ) from None
    return values
