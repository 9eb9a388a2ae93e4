"""MAT files: their vectors are columns. What a compressed variable inflates to is known before it is inflated."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from suite.columns import MOST, Array, Table, floats, refuse_many, refuse_wide
from suite.errors import DataError

HEAD = 128  # bytes before the first variable of version 5
COMPRESSED = 15
LARGEST = 16 * MOST  # bytes that one variable may inflate to
RATIO = 1040  # bytes that deflate can make of one at most
PIECE = 1 << 20
NUMBERS = frozenset([
    "double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "logical", "cell",
])  # fmt: skip


def read(file: Path) -> Table:
    """The table in a file. Raises DataError."""
    from scipy.io import loadmat, whosmat

    _refuse_bombs(file)
    # Vectors are columns, whichever way they lie; constants and matrices beside them are no one's column.
    listed = _loaded(file, whosmat)
    vectors = {
        name: max(shape)
        for name, shape, kind in listed
        if len(shape) == 2 and 1 == min(shape) < max(shape) and kind in NUMBERS
    }

    refuse_wide(file.name, len(vectors))

    def columns(wanted: Sequence[str]) -> dict[str, Array]:
        lengths = {name: vectors[name] for name in wanted}
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise DataError(f"{file.name}: the columns differ in length ({shown}); save vectors of one length")
        refuse_many(file.name, max(lengths.values(), default=0), len(lengths))
        contents = _loaded(file, loadmat, variable_names=list(lengths))
        if not all(np.size(contents.get(name)) == length for name, length in lengths.items()):
            raise DataError(f"{file.name}: damaged; save it again with save(..., '-v7')")
        return {name: floats(file.name, name, np.reshape(contents[name], -1)) for name in lengths}

    return Table(file.name, tuple(vectors), columns, lambda row: f"sample {row + 1}")


def _loaded(file: Path, call: Any, **wanted: Any) -> Any:
    try:
        with warnings.catch_warnings():
            # Of variables that are there twice, and of types that are no numbers anyway.
            warnings.simplefilter("ignore")
            return call(file, **wanted)
    except NotImplementedError:
        raise DataError(f"{file.name}: a MAT file of version 7.3 is not read; save it with save(..., '-v7')") from None
    except Exception:  # scipy has no error of its own for what is damaged: it fails wherever that is met
        raise DataError(f"{file.name}: not a MAT file; save it with save(..., '-v7')") from None


def _refuse_bombs(file: Path) -> None:
    """Refuse a variable that inflates to too much, or to more than its head says."""
    with file.open("rb") as handle:
        head = handle.read(HEAD)
        if len(head) < HEAD or head[126:128] not in (b"IM", b"MI"):
            return  # version 4, which is not compressed, or none
        order = "<" if head[126:128] == b"IM" else ">"
        while len(tag := handle.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            end = handle.tell() + size
            if kind == COMPRESSED:
                _refuse_bomb(file.name, handle, size, order)
            handle.seek(end)


def _refuse_bomb(file: str, handle: BinaryIO, size: int, order: str) -> None:
    stream = zlib.decompressobj()
    try:
        start = stream.decompress(handle.read(min(size, 1024)), 8)
        if len(start) < 8:
            return  # scipy says that it is damaged
        stated = int(struct.unpack(f"{order}I", start[4:])[0])
        if stated > LARGEST:
            raise _bomb(file)
        if size * RATIO <= LARGEST:
            return
        left, made = size - 1024, 8
        packed = stream.unconsumed_tail
        while packed or left > 0:
            if not packed:
                packed = handle.read(min(left, PIECE))
                left -= PIECE
                if not packed:
                    return
            made += len(stream.decompress(packed, PIECE))
            packed = stream.unconsumed_tail
            if made > stated + 8:
                raise _bomb(file)
            if stream.eof:
                return
    except zlib.error:
        return


def _bomb(file: str) -> DataError:
    return DataError(
        f"{file}: a variable inflates to more than {LARGEST // 10**6} MB or than it says; save fewer samples in a file"
    )
