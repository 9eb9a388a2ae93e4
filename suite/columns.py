"""A table of measured columns, however its file holds it, and what a column may be."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from suite.errors import DataError

Array = npt.NDArray[np.float64]

# Numbers taken from one file at most, 0.8 GB of them. Of a compressed file of any size this bounds what it expands to.
MOST = 100_000_000
MOST_COLUMNS = 10_000
DATE = re.compile(r"\d{4}[-/]\d{1,2}[-/]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4}|\d{1,2}:\d{2}")
CONVERT = "convert dates to seconds from the start"


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


def refuse_wide(file: str, columns: int) -> None:
    """Refuse a table of more columns than anyone measures."""
    if columns > MOST_COLUMNS:
        raise DataError(
            f"{file}: {columns} columns, at most {MOST_COLUMNS} are read; leave out what the model does not name, or "
            "write one sample a line"
        )


def joined(parts: list[Array]) -> Array:
    """The pieces of a column as one; they are let go."""
    whole = np.concatenate(parts) if parts else np.empty(0)
    parts.clear()
    return whole


def mend(cell: str) -> str:
    """What to do about a cell that is no number."""
    return CONVERT if DATE.match(cell) else "correct it, or leave the cell empty if it is missing"


def floats(file: str, name: str, column: npt.NDArray[np.generic]) -> Array:
    """A column (N,) of any type as numbers."""
    if column.dtype.kind in "biuf":
        return column.astype(np.float64)
    if column.dtype.kind in "Mm":
        raise DataError(f"{file}, column {name}: holds dates; {CONVERT}")
    if column.dtype.kind == "c":
        raise DataError(f"{file}, column {name}: holds complex numbers; save their parts as columns")
    values = np.empty(len(column))
    for row, cell in enumerate(column.tolist()):
        try:
            values[row] = np.nan if cell is None else float(cell)
        except (TypeError, ValueError, OverflowError):
            raise DataError(
                f"{file}, row {row + 1}, column {name}: expected a number, got {repr(cell)[:40]}; "
                f"{mend(str(cell)[:40])}"
            ) from None
    return values
