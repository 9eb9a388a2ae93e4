"""The result table: its columns declared once, shown as text, CSV, parquet or JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from suite.benchmark.statistics import summarise
from suite.errors import InputError
from suite.files import write_whole, written_whole

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """A column: its field, its heading in a text table, how a value is written, and what it means in a phrase."""

    field: str
    heading: str
    form: Callable[[Any], str]
    meaning: str


def _number(value: Any) -> str:
    if value is None:
        return ""
    return "failed" if math.isinf(value) else f"{value:.3g}"


def _text(value: Any) -> str:
    return "" if value is None else str(value)


METRICS = ("state_nrmse", "d_nrmse", "parameter_worst", "named", "nees", "nis", "step_us")

COLUMNS = (
    Column("case", "case", _text, "the case"),
    Column("noise", "noise", _number, "noise as a fraction of each output's standard deviation"),
    Column("estimator", "estimator", _text, "the estimator"),
    Column("variant", "variant", _text, "default, or tuned with the common budget"),
    Column("ok", "ok", _text, "seeds that ended well"),
    Column("seeds", "of", _text, "seeds"),
    Column("state_nrmse", "state error", _number, "RMSE of the states over their standard deviations, median"),
    Column("ratio", "/ ekf", _number, "state error over the untuned EKF's on the same seed, median"),
    Column("d_nrmse", "d error", _number, "RMSE of the model error over its own RMS, median"),
    Column("parameter_worst", "coefficient", _number, "worst relative error of the missing coefficients, median"),
    Column("named", "named", _number, "1 where the effect's shape is recognised, median"),
    Column("nees", "NEES", _number, "normalised estimation error squared over n, median; 1 is consistent"),
    Column("nis", "NIS", _number, "normalised innovation squared over outputs, median; 1 is consistent"),
    Column("step_us", "us/step", _number, "run time a step in microseconds, median"),
    Column("reason", "reason", lambda value: _text(value)[:60], "why seeds failed, the first"),
)


def lines(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """The summary: one line a case, noise, estimator and variant."""
    return summarise(rows, METRICS)


def text(summary: Sequence[Row]) -> str:
    """The summary as a plain table."""
    cells = [[column.heading for column in COLUMNS]]
    cells += [[column.form(line.get(column.field)) for column in COLUMNS] for line in summary]
    return grid(cells)


def grid(cells: Sequence[Sequence[str]]) -> str:
    """Cells as aligned text; the first row is the heading."""
    widths = [max(len(row[j]) for row in cells) for j in range(len(cells[0]))]
    laid = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]
    return "\n".join([laid[0], "-" * len(laid[0]), *laid[1:]])


def markdown(cells: Sequence[Sequence[str]]) -> str:
    """Cells as a Markdown table; the first row is the heading."""
    rows = ["| " + " | ".join(row) + " |" for row in cells]
    return "\n".join([rows[0], "|" + "---|" * len(cells[0]), *rows[1:]])


def plain(value: Any) -> Any:
    """A value that JSON can hold: infinities and NaN become null, so that any reader takes it."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def to_json(thing: Any) -> str:
    """Standard JSON."""
    return json.dumps(plain(thing), indent=1, allow_nan=False)


def flat(row: Row) -> dict[str, Any]:
    """A row with its inner tables spread over columns, such as state_rmse.x1."""
    spread: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, Mapping):
            spread |= {f"{key}.{name}": entry for name, entry in value.items()}
        else:
            spread[key] = value
    return spread


def write(rows: Sequence[Row], path: Path) -> None:
    """Write rows by the ending of the path, .csv, .parquet or .json; whole or not at all."""
    import pandas as pd

    if path.suffix not in (".csv", ".parquet", ".json"):
        raise InputError(f"{path}: a table is written as .csv, .parquet or .json; change the ending")
    if path.suffix == ".json":
        write_whole(path, to_json(list(rows)) + "\n")
        return
    frame = pd.DataFrame([flat(row) for row in rows])
    with written_whole(path) as beside:
        if path.suffix == ".csv":
            frame.to_csv(beside, index=False)
        else:
            # A column that is a number here and a word there (a report's) is written as text.
            words = [name for name in frame if frame[name].map(lambda value: isinstance(value, str)).any()]
            frame.astype(dict.fromkeys(words, str)).to_parquet(beside, index=False)
