"""Parquet files: of all types and nestings, cut, flipped, and small ones that hold much."""

from __future__ import annotations

import datetime
import decimal
import io
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from csv_file import read
from hypothesis import strategies as st
from mutations import bytewise, words
from oracle import Oracle

ROWS = 6
TIMES = [datetime.datetime(2024, 1, 1, 0, 0, k) for k in range(ROWS)]
COLUMNS: dict[str, Any] = {
    "rising": list(range(ROWS)),
    "float": [0.5 * k for k in range(ROWS)],
    "half": pa.array(np.arange(ROWS, dtype=np.float16)),
    "bool": [k > 2 for k in range(ROWS)],
    "text": [str(k) for k in range(ROWS)],
    "word": ["fuzz_canary"] * ROWS,
    "null": pa.nulls(ROWS),
    "gaps": [None, 1.0, None, 2.0, 3.0, None],
    "dates": TIMES,
    "zoned": pa.array(TIMES, pa.timestamp("ns", "Europe/Berlin")),
    "days": [time.date() for time in TIMES],
    "clock": [time.time() for time in TIMES],
    "span": pa.array([datetime.timedelta(seconds=k) for k in range(ROWS)]),
    "decimal": [decimal.Decimal(k) for k in range(ROWS)],
    "list": [[k] for k in range(ROWS)],
    "struct": [{"a": k} for k in range(ROWS)],
    "map": pa.array([[("a", k)] for k in range(ROWS)], pa.map_(pa.string(), pa.int64())),
    "binary": [b"\xff"] * ROWS,
    "fixed": pa.array([b"abcd"] * ROWS, pa.binary(4)),
    "category": pa.array(["a", "b"] * 3).dictionary_encode(),
    "numbers": pa.array([1.0, 2.0] * 3).dictionary_encode(),
    "large": [2**63 - 1] * ROWS,
    "unsigned": pa.array([2**64 - 1] * ROWS, pa.uint64()),
    "huge": ["a" * 100_000] * ROWS,
    "infinite": [float("inf")] * ROWS,
}  # fmt: skip
names = st.one_of(st.sampled_from(["t", "u", "y", "y", "Y", "time"]), words.map(lambda text: text.replace("\0", "")))


def _bytes(table: pa.Table, compression: str) -> bytes:
    out = io.BytesIO()
    pq.write_table(table, out, compression=compression)
    return out.getvalue()


@st.composite
def files(draw: st.DrawFn) -> bytes:
    kinds = st.sampled_from(sorted(COLUMNS))
    columns = [("t", draw(st.one_of(st.just("rising"), kinds))), ("u", draw(kinds)), ("y", draw(kinds))]
    columns += draw(st.lists(st.tuples(names, kinds), max_size=2))
    arrays = [pa.array(COLUMNS[kind]) for _, kind in columns]
    try:
        data = _bytes(
            pa.Table.from_arrays(arrays, [name for name, _ in columns]),
            draw(st.sampled_from(["snappy", "zstd", "none"])),
        )
    except (pa.ArrowException, UnicodeEncodeError):
        data = b"PAR1"
    return draw(st.one_of(st.just(data), bytewise(data)))


def _bomb(rows: int, kind: Any) -> bytes:
    column = (
        pa.array(np.zeros(rows, kind)) if kind is not str else pa.array([""]).take(pa.array(np.zeros(rows, np.int8)))
    )
    return _bytes(pa.table({"t": column, "u": column, "y": column}), "zstd")


def bombs() -> list[bytes]:
    """Some kilobytes that are gigabytes when read."""
    return [_bomb(120_000_000, np.float64), _bomb(60_000_000, str)]


strategy = files()


def prepare(oracle: Oracle, folder: Path) -> Any:
    """The file as a record of a model."""
    return lambda given: read(oracle, folder / "run.parquet", given)
