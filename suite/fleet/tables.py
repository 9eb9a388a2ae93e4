"""The table of a fleet, one line a file, as parquet and CSV at once: its columns, and a writer that holds few rows."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from suite.files import written_whole

# Name, type and meaning; where nothing was judged, numbers are empty and so are the words after `reason`.
COLUMNS = (
    ("rank", "int64", "1 is the worst: by error over noise, then by weight; empty where nothing was judged"),
    ("file", "string", "the file, as it was given"),
    ("status", "string", "ok; refused: the data cannot be used; time-out; error"),
    ("reason", "string", "why there is no verdict, in a sentence"),
    ("verdict", "string", "missing_effect, ambiguous, unexplained or adequate"),
    (
        "effects",
        "string",
        "what is missing as effect@equation, joined by ` + `; of an ambiguous verdict the most likely",
    ),
    ("term", "string", "the terms of these effects"),
    ("missing", "string", "the effects with their terms and coefficients in words"),
    ("coefficients", "string", "the coefficients as JSON: value, sd and, where it is known, unit"),
    ("weight", "double", "weight of the named effects among all hypotheses"),
    ("sentence", "string", "the verdict in a sentence"),
    ("plausible", "string", "what else fits, each with its weight"),
    ("lambda", "double", "how much better the best constant push fits than none, in log likelihood"),
    ("ljung_box_p", "double", "p that the residuals of the model as it is are white"),
    ("samples", "int64", "samples of the file"),
    ("seconds", "double", "time of the verdict"),
    ("peak_mb", "double", "largest memory so far of the process that judged it"),
    ("ratio", "double", "error over noise, the largest of the outputs; infinite where the simulation ran away"),
)
# One column an output, such as noise.pos.
EACH = (
    ("error_before", "RMSE of the calibrated model, in the output's unit"),
    ("error_after", "RMSE with the named effects"),
    ("noise", "standard deviation of the sensor, stated or estimated"),
    ("error_over_noise", "error_before over noise"),
)
PART = 1000


def names(outputs: Sequence[str]) -> dict[str, str]:
    """The columns and their types, for a model with these outputs."""
    each = {f"{name}.{output}": "double" for name, _ in EACH for output in outputs}
    return {**{name: kind for name, kind, _ in COLUMNS}, **each}


def write(rows: Iterable[Mapping[str, Any]], outputs: Sequence[str], parquet: Path, text: Path) -> None:
    """Write ranked rows, the judged ones first, to both files; each is written whole or not at all."""
    columns = names(outputs)
    schema = pa.schema(
        [(name, getattr(pa, "float64" if kind == "double" else kind)()) for name, kind in columns.items()]
    )
    source = _lines(rows, list(columns))
    with (
        written_whole(parquet) as binary,
        written_whole(text) as beside,
        pq.ParquetWriter(binary, schema) as table,
        beside.open("w", encoding="utf-8", newline="") as handle,
    ):
        sheet = csv.writer(handle, lineterminator="\n")
        sheet.writerow(columns)
        while part := list(islice(source, PART)):
            sheet.writerows(part)
            table.write_batch(pa.record_batch([list(column) for column in zip(*part, strict=True)], schema=schema))


def _lines(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Iterator[list[Any]]:
    """The values of each row in the order of the columns, None where there is none."""
    for k, row in enumerate(rows):
        values = {**row, "rank": k + 1 if row["status"] == "ok" else None}
        for name, _ in EACH:
            inner = values.pop(name, None)
            values |= {f"{name}.{output}": value for output, value in (inner or {}).items()}
        yield [_clean(values.get(name)) for name in columns]


def _clean(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value
