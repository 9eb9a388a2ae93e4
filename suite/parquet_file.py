"""Parquet files, read in pieces: kilobytes of one can stand for gigabytes, which are refused before they are made."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from suite.columns import CONVERT, MOST, Array, Table, floats, joined, mend, refuse_many, refuse_wide
from suite.errors import DataError

PIECE = 65_536  # rows read at a time


def read(file: Path) -> Table:
    """The table in a file. Raises DataError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(file) as opened:
            schema = opened.schema_arrow
            names = tuple(schema.names)
    except (pa.ArrowException, OSError, MemoryError, UnicodeDecodeError, RecursionError):
        raise DataError(f"{file.name}: not a parquet file; write it again or save it as CSV") from None

    refuse_wide(file.name, len(names))

    def columns(wanted: Sequence[str]) -> dict[str, Array]:
        kinds = {name: schema.field(name).type for name in dict.fromkeys(wanted)}
        for name, kind in kinds.items():
            _refuse_kind(file.name, name, kind)
        # Words that repeat are stored once, and stay so here.
        words = [name for name, kind in kinds.items() if pa.types.is_string(kind) or pa.types.is_large_string(kind)]
        try:
            with pq.ParquetFile(file, read_dictionary=words) as opened:
                _refuse_large(file.name, opened.metadata, len(kinds))
                pieces = opened.iter_batches(batch_size=PIECE, columns=list(kinds), use_threads=False)
                return _joined(file.name, list(kinds), pieces)
        except (pa.ArrowException, OSError, MemoryError, UnicodeDecodeError):
            raise DataError(f"{file.name}: damaged; write it again or save it as CSV") from None

    return Table(file.name, names, columns, lambda row: f"row {row + 1}")


def _refuse_large(file: str, metadata: Any, columns: int) -> None:
    refuse_many(file, metadata.num_rows, columns)
    for group in range(metadata.num_row_groups):
        part = metadata.row_group(group)
        for at in range(part.num_columns):
            if part.column(at).total_uncompressed_size > 8 * MOST:
                raise DataError(f"{file}: a column of more than {8 * MOST // 10**6} MB; split it into several files")


def _refuse_kind(file: str, name: str, kind: Any) -> None:
    import pyarrow as pa

    types = pa.types
    if types.is_dictionary(kind):
        kind = kind.value_type
    if types.is_temporal(kind):
        raise DataError(f"{file}, column {name}: holds dates; {CONVERT}")
    numbers = types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or types.is_decimal(kind)
    if not (numbers or types.is_null(kind) or types.is_string(kind) or types.is_large_string(kind)):
        raise DataError(f"{file}, column {name}: holds {str(kind)[:60]}, expected numbers; save one number a row")


def _joined(file: str, names: Sequence[str], pieces: Any) -> dict[str, Array]:
    found: dict[str, list[Array]] = {name: [] for name in names}
    rows = 0
    for piece in pieces:
        for name in names:
            found[name].append(_numbers(file, name, piece.column(name), rows))
        rows += piece.num_rows
        # The head of a damaged file may say less than comes.
        refuse_many(file, rows, len(names))
    return {name: joined(parts) for name, parts in found.items()}


def _numbers(file: str, name: str, column: Any, first: int) -> Array:
    """One piece of a column; a word is read once, at the first row where it stands."""
    import pyarrow as pa

    if not pa.types.is_dictionary(column.type):
        return floats(file, name, column.to_pandas().to_numpy())
    at = column.indices.to_numpy(zero_copy_only=False)
    known = ~np.isnan(at)
    values = np.full(len(at), np.nan)
    used, back = np.unique(at[known].astype(np.int64), return_inverse=True)
    numbers = np.empty(len(used))
    for k, place in enumerate(used.tolist()):
        cell = column.dictionary[place].as_py()
        try:
            numbers[k] = np.nan if cell is None else float(cell)
        except (TypeError, ValueError, OverflowError):
            row = first + int(np.flatnonzero(at == place)[0]) + 1
            raise DataError(
                f"{file}, row {row}, column {name}: expected a number, got {repr(cell)[:40]}; {mend(str(cell)[:40])}"
            ) from None
    values[known] = numbers[back]
    return values
