"""From data files to a Record: the model names the columns, every file is one run."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from suite.errors import DataError
from suite.model import Model
from suite.record import Record, join
from suite.tables import Table, read_table, write_csv

__all__ = ["read_record", "read_table", "write_csv"]

Array = npt.NDArray[np.float64]


def read_record(paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], model: Model) -> Record:
    """The measurements that a model asks for; several files are several runs of the same plant.

    Empty cells are NaN in outputs; in inputs they are filled as the input's hold says. Raises DataError: one sentence
    with file, place and mend.
    """
    several = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not several:
        raise DataError("no data files; give one or several CSV, parquet or MAT files")
    record = join([_run(read_table(path), model) for path in several])
    for c, (name, output) in enumerate(model.outputs.items()):
        if np.all(np.isnan(record.y[:, c])):
            raise DataError(
                f"{record.source}, column {output.column}: no value at all for the output {name}; "
                "leave the output out of the model or measure it"
            )
    return record


def _run(table: Table, model: Model) -> Record:
    """One file as one run."""
    if not model.outputs:
        raise DataError(f"{table.file}: the model has no outputs to compare with; add a table [outputs]")
    time = time_column(table, model)
    inputs = [entry.column for entry in model.inputs.values()]
    outputs = [entry.column for entry in model.outputs.values()]
    for name in (*inputs, *outputs):
        there(table, name)
    columns = table.read([*dict.fromkeys([time, *inputs, *outputs])])
    for name, column in columns.items():
        if np.any(np.isinf(column)):
            at = table.place(int(np.argmax(np.isinf(column))))
            raise DataError(
                f"{table.file}, {at}, column {name}: an infinite value; leave the cell empty if it is missing"
            )
    t = columns[time]
    _check_time(table, time, t)
    filled = [_filled(table, entry.column, entry.hold, t, columns[entry.column]) for entry in model.inputs.values()]
    return Record(
        t=t,
        u=np.column_stack(filled) if filled else np.empty((len(t), 0)),
        y=np.column_stack([columns[name] for name in outputs]),
        names=(table.file,),
        source=table.file,
    )


def time_column(table: Table, model: Model) -> str:
    """The model's time column; where it names none, `t`, else the first one that is nothing else."""
    if model.time is not None:
        there(table, model.time)
        return model.time
    if "t" in table.columns:
        there(table, "t")
        return "t"
    used = {entry.column: name for name, entry in model.inputs.items()}
    used |= {entry.column: name for name, entry in model.outputs.items()}
    first = table.columns[0] if table.columns else ""
    if not first or first in used:
        taken = f"the first column {first!r} is {used[first]}" if first else "no columns"
        raise DataError(
            f'{table.file}: no time column ({taken}); add a column t, or name it in the model file: time = "..."'
        )
    return first


def there(table: Table, name: str) -> None:
    """Refuse a column that is missing or there twice, with those that are there."""
    count = table.columns.count(name)
    if count > 1:
        raise DataError(f"{table.file}: {count} columns are called {name!r}; rename all but one")
    if count == 1:
        return
    shown = ", ".join(table.columns[:12]) + (", ..." if len(table.columns) > 12 else "")
    lowered = {column.lower(): column for column in table.columns}
    close = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.6)
    hint = f", did you mean {lowered[close[0]]!r}" if close else ""
    raise DataError(
        f"{table.file}: no column {name!r} (it has {shown or 'none'}){hint}; correct the name in the model file"
    )


def _check_time(table: Table, name: str, t: Array) -> None:
    if len(t) < 2:
        raise DataError(f"{table.file}: {len(t)} row(s), at least 2 are needed; add measurements")
    missing = np.isnan(t)
    if missing.any():
        at = table.place(int(np.argmax(missing)))
        raise DataError(f"{table.file}, {at}, column {name}: no time; fill the cell or delete the row")
    backward = np.diff(t) <= 0
    if backward.any():
        row = int(np.argmax(backward)) + 1
        what = "repeats" if t[row] == t[row - 1] else "runs backwards"
        raise DataError(
            f"{table.file}, {table.place(row)}, column {name}: time {what} ({t[row]!s} after {t[row - 1]!s}); "
            "sort the rows, or give each run a file of its own"
        )


def _filled(table: Table, name: str, hold: str, t: Array, u: Array) -> Array:
    """An input with its gaps filled: the last value before, or a line across."""
    missing = np.isnan(u)
    if not missing.any():
        return u
    if missing[0]:
        raise DataError(
            f"{table.file}, {table.place(0)}, column {name}: the input is empty at the start; "
            "begin at the first row where it is known"
        )
    known = np.flatnonzero(~missing)
    if hold == "linear":
        return np.interp(t, t[known], u[known])
    # The row of the last known value, carried forward.
    return u[np.maximum.accumulate(np.where(missing, 0, np.arange(len(u))))]
