"""Samples from lines of CSV as they come, the header first. Each defect is named with its line."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator
from typing import TextIO

import numpy as np
import numpy.typing as npt

from suite.columns import mend
from suite.errors import DataError
from suite.model import Model
from suite.readers import there, time_column
from suite.tables import DECIMAL_COMMA, MISSING, TOLD, Table, separator

Array = npt.NDArray[np.float64]
Sample = tuple[float, Array, Array]
LONGEST = 1 << 20  # characters of a line


def lines_of(stream: TextIO, source: str) -> Iterator[str]:
    """A stream's lines as they come. Raises DataError at one that does not end."""
    for at, line in enumerate(iter(lambda: stream.readline(LONGEST), ""), 1):
        if len(line) == LONGEST and not line.endswith("\n"):
            raise DataError(f"{source}, line {at}: longer than {LONGEST} characters; put each sample on a line")
        yield line


def samples(lines: Iterable[str], model: Model, source: str) -> Iterator[Sample]:
    """Each line's time, inputs (inputs,) and outputs (outputs,; NaN where the cell is empty), as soon as it is there.

    Empty lines and lines that open with # are passed over; an empty input keeps its last value. Raises DataError.
    """
    numbered = ((at, line) for at, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#"))
    found = next(numbered, None)
    told = TOLD.match(found[1]) if found else None
    if told:
        found = next(numbered, None)
    if found is None:
        raise DataError(f"{source}: no lines; expected a line of column names, then a sample a line")
    reader = _Reader(found[1], model, source, told[1] if told else separator(found[1]))
    for at, line in numbered:
        sample = reader.sample(at, line)
        if sample is not None:
            yield sample


def _missing(cell: str) -> bool:
    return cell.strip().lower() in MISSING


class _Reader:
    """The columns, and what the last line said."""

    def __init__(self, header: str, model: Model, source: str, mark: str) -> None:
        self.source, self.mark = source, mark
        names = [name.strip() for name in self.cells(header)]
        while names and not names[-1]:
            names.pop()
        table = Table(source, tuple(names), lambda _: {}, lambda row: f"line {row + 2}")
        if not model.outputs:
            raise DataError(f"{source}: the model has no outputs to compare with; add a table [outputs]")
        time = time_column(table, model)
        wanted = [entry.column for entry in model.inputs.values()]
        wanted += [entry.column for entry in model.outputs.values()]
        for column in wanted:
            there(table, column)
        self.names = names
        self.columns = [names.index(column) for column in (time, *wanted)]
        self.inputs = len(model.inputs)
        self.t, self.u = -math.inf, [math.nan] * self.inputs

    def cells(self, line: str) -> list[str]:
        if '"' not in line:
            return line.rstrip("\r\n").split(self.mark)
        try:
            return next(csv.reader([line.rstrip("\r\n")], delimiter=self.mark, skipinitialspace=True), [])
        except csv.Error:
            most = csv.field_size_limit()
            raise DataError(f"{self.source}: a cell of more than {most} characters; close its quote") from None

    def sample(self, at: int, line: str) -> Sample | None:
        """The sample in line `at`, None where every cell is empty."""
        cells, width = self.cells(line), len(self.names)
        # A line in which every cell is empty has no time either.
        if (len(cells) < width or _missing(cells[self.columns[0]])) and all(map(_missing, cells)):
            return None
        if len(cells) != width and (len(cells) < width or any(cell.strip() for cell in cells[width:])):
            raise self.refuse(at, f"{len(cells)} cells under {width} column names", "give each its cell")
        numbers = [self.number(at, cells[column], self.names[column]) for column in self.columns]
        t = numbers[0]
        if math.isnan(t):
            raise self.refuse(at, f"no time in column {self.names[self.columns[0]]}", "fill the cell or leave the line")
        if t <= self.t:
            raise self.refuse(at, f"time does not increase ({t!r} after {self.t!r})", "send the samples in order")
        self.t = t
        given = numbers[1 : 1 + self.inputs]
        self.u = [old if math.isnan(new) else new for new, old in zip(given, self.u, strict=True)]
        for place, value in enumerate(self.u):
            if math.isnan(value):
                name = self.names[self.columns[1 + place]]
                raise self.refuse(at, f"the input {name} is empty at the start", "begin where it is known")
        # The type is said, for a model without inputs has an empty list.
        return t, np.array(self.u, dtype=np.float64), np.array(numbers[1 + self.inputs :], dtype=np.float64)

    def number(self, at: int, cell: str, name: str) -> float:
        text = cell.strip()
        try:
            value = float(text)
            if math.isfinite(value) and "_" not in text:
                return value
        except ValueError:
            pass
        if _missing(text):
            return math.nan
        if self.mark != "," and DECIMAL_COMMA.match(text):
            text = text.replace(",", ".")
        try:
            value = math.nan if "_" in text else float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            shown = text if len(text) <= 40 else text[:37] + "..."
            raise self.refuse(at, f"expected a number, got {shown!r}", mend(text), f", column {name}")
        return value

    def refuse(self, at: int, what: str, advice: str, column: str = "") -> DataError:
        return DataError(f"{self.source}, line {at}{column}: {what}; {advice}")
