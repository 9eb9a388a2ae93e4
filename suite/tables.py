"""Tables of measured columns: CSV, parquet and MAT in, CSV out. Every defect is named with its file and place."""

from __future__ import annotations

import csv
import io
import itertools
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from suite import mat_file, parquet_file
from suite.columns import Array, Table, joined, mend, refuse_wide
from suite.errors import DataError
from suite.files import write_whole
from suite.text_file import text_of

__all__ = ["Table", "read_table", "write_csv"]

# What pandas and people write for "nothing was measured here".
MISSING = frozenset({"", "na", "n/a", "#n/a", "nan", "-nan", "null", "none", "<na>"})
DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*\Z")
CELLS = 1 << 20  # of a table that are read at a time
# The line by which a spreadsheet is told the separator.
TOLD = re.compile(r'"?sep=([,;\t])"?\s*\Z', re.IGNORECASE)


def read_table(path: str | os.PathLike[str]) -> Table:
    """The table in a file, its kind told by the suffix. Raises DataError."""
    file = Path(path)
    if file.is_dir():
        raise DataError(f"{file}: is a folder; give the data files in it")
    if not file.is_file():
        raise DataError(f"{file}: no such file; check the path")
    kinds = {
        ".csv": _csv,
        ".tsv": _csv,
        ".txt": _csv,
        ".dat": _csv,
        ".parquet": parquet_file.read,
        ".pq": parquet_file.read,
        ".mat": mat_file.read,
    }
    kind = kinds.get(file.suffix.lower())
    if kind is None:
        raise DataError(f"{file.name}: files {file.suffix or 'without a suffix'} are not read; save it as CSV")
    if not file.stat().st_size:
        raise DataError(f"{file.name}: the file is empty; expected a line of column names and rows of numbers")
    try:
        return kind(file)
    except OSError as error:
        raise DataError(f"{file.name}: cannot be read ({error.strerror or 'damaged'}); check the file") from None


def write_csv(path: str | os.PathLike[str], columns: Mapping[str, npt.ArrayLike]) -> None:
    """Write columns of equal length as CSV, in full precision, NaN as an empty cell; whole or not at all."""
    arrays = [np.asarray(column, dtype=np.float64) for column in columns.values()]
    if len({array.shape for array in arrays}) != 1 or arrays[0].ndim != 1:
        raise DataError(f"{path}: expected columns of one length, got {[a.shape for a in arrays]}; align them")
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    texts = [["" if value != value else repr(value) for value in array.tolist()] for array in arrays]
    writer.writerows(zip(*texts, strict=True))
    write_whole(path, out.getvalue())


def _csv(file: Path) -> Table:
    return _Text(file).table()


class _Text:
    """A text table: separator, decimal sign and header are found; pandas reads the numbers.

    The rows are walked in Python only where something is wrong, to say which line it is.
    """

    def __init__(self, file: Path) -> None:
        self.name = file.name
        self.text = text_of(file)
        with self.text.opened() as handle:
            head = handle.read(100_000).split("\n")
        marks, told = 0, None
        while marks < len(head):
            found = TOLD.match(head[marks])
            told = told or found
            if not found and head[marks].strip() and not head[marks].lstrip().startswith("#"):
                break
            marks += 1
        if marks == len(head):
            raise DataError(f"{self.name}: no rows; expected a line of column names and rows of numbers")
        # Some programs write the names as the last of the comment lines.
        self.separator = told[1] if told else separator(head[marks])
        if (
            marks
            and head[marks - 1].lstrip().startswith("#")
            and all(_is_number(cell) for cell in self.split(head[marks], marks + 1))
        ):
            marks -= 1
        # Lines before the names, counted from the file's start.
        self.skipped = marks
        names = [name.strip() for name in self.split(head[marks].lstrip("# "), marks + 1)]
        while names and not names[-1]:
            names.pop()
        self.names = names
        if all(_is_number(name) for name in names):
            raise DataError(
                f"{self.name}, line {marks + 1}: numbers where the column names should be; add a header line"
            )
        first = next((row for _, row in self.rows()), None)
        if first is None:
            raise DataError(f"{self.name}: column names and no rows; add measurements")
        self.width = max(len(names), len(first))
        refuse_wide(self.name, self.width)
        # Some numbers of a file may be whole, so one row is not enough to tell.
        early = [cell for _, row in itertools.islice(self.rows(), 200) for cell in row[: self.width]]
        comma = self.separator != "," and any(DECIMAL_COMMA.match(cell) for cell in early)
        self.decimal = "," if comma else "."
        self.refuse_wide(*next(self.rows()))

    def split(self, line: str, at: int) -> list[str]:
        try:
            return next(csv.reader([line.rstrip("\r")], delimiter=self.separator, skipinitialspace=True), [])
        except csv.Error:
            raise self.long(at) from None

    def long(self, line: int) -> DataError:
        """The sentence for what the csv module does not read: a cell of more than 131,072 characters."""
        return DataError(
            f"{self.name}, line {line}: a cell of more than {csv.field_size_limit()} characters; close its quote"
        )

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Rows that hold something, each with its line number."""
        with self.text.opened() as handle:
            reader = csv.reader(handle, delimiter=self.separator, skipinitialspace=True)
            while True:
                try:
                    row = next(reader)
                except StopIteration:
                    return
                except csv.Error:
                    raise self.long(reader.line_num) from None
                if reader.line_num > self.skipped + 1 and not all(cell.strip().lower() in MISSING for cell in row):
                    yield reader.line_num, row

    def refuse_wide(self, line: int, row: list[str]) -> None:
        if any(cell.strip() for cell in row[len(self.names) :]):
            hint = "; decimal commas need another separator" if self.separator == "," else ""
            raise DataError(
                f"{self.name}, line {line}: {len(row)} cells under {len(self.names)} column names{hint}; "
                "give each cell a column"
            )

    def table(self) -> Table:
        return Table(self.name, tuple(self.names), self.read, self.place)

    def place(self, row: int) -> str:
        for at, (line, _) in enumerate(self.rows()):
            if at == row:
                return f"line {line}"
        return f"row {row + 1}"

    def read(self, columns: Sequence[str]) -> dict[str, Array]:
        """The columns, of which alone every piece of the rows leaves something."""
        import pandas as pd

        wanted = [self.names.index(name) for name in columns]
        # Every digit counts; newer versions read them all without being asked, and warn when asked.
        exact: Any = {} if int(pd.__version__.partition(".")[0]) >= 3 else {"float_precision": "round_trip"}
        parts: list[list[Array]] = [[] for _ in columns]
        try:
            with self.text.opened() as handle:
                frames = pd.read_csv(
                    handle,
                    sep=self.separator,
                    decimal=self.decimal,
                    header=None,
                    names=list(range(self.width)),
                    skiprows=self.skipped + 1,
                    # All columns, as text where not wanted: with `usecols` pandas drops surplus cells silently.
                    dtype={at: np.float64 if at in wanted else str for at in range(self.width)},
                    index_col=False,
                    na_values=sorted(MISSING),
                    skipinitialspace=True,
                    engine="c",
                    chunksize=max(1, CELLS // self.width),
                    **exact,
                )
                for frame in frames:
                    blank = frame.isna().all(axis=1)
                    if blank.any():  # the rows that spreadsheets append
                        frame = frame[~blank]
                    for part, at in zip(parts, wanted, strict=True):
                        part.append(frame[at].to_numpy(dtype=np.float64, copy=True))
        except (ValueError, pd.errors.ParserError):
            raise self.offence(columns) from None
        return {name: joined(part) for name, part in zip(columns, parts, strict=True)}

    def offence(self, columns: Sequence[str]) -> DataError:
        """The sentence for the first cell that is no number."""
        wanted = [(name, self.names.index(name)) for name in columns]
        for line, row in self.rows():
            try:
                self.refuse_wide(line, row)
            except DataError as error:
                return error
            for name, at in wanted:
                cell = row[at].strip() if at < len(row) else ""
                if not _is_number(cell.replace(self.decimal, ".")) and cell.lower() not in MISSING:
                    shown = cell if len(cell) <= 40 else cell[:37] + "..."
                    return DataError(
                        f"{self.name}, line {line}, column {name}: expected a number, got {shown!r}; {mend(cell)}"
                    )
        return DataError(f"{self.name}: not a table of numbers; check its separators and quotes")


def separator(line: str) -> str:
    """The separator that splits the header most; names in quotes may hold others."""
    bare = re.sub(r'"[^"]*"', "", line)
    return max((",", ";", "\t"), key=bare.count)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
