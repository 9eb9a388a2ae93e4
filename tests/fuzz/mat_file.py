"""MAT files: of all kinds of variables, cut, flipped, and small ones that hold much."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse
from csv_file import read
from hypothesis import strategies as st
from mutations import bytewise
from oracle import Oracle

RISING = np.arange(6.0)
VARIABLES: dict[str, Any] = {
    "rising": RISING,
    "column": RISING.reshape(-1, 1),
    "cube": np.zeros((2, 2, 2)),
    "empty": np.zeros((0, 0)),
    "scalar": 3.0,
    "whole": np.arange(6, dtype=np.int8),
    "complex": RISING + 1j,
    "text": "fuzz_canary",
    "texts": np.array(["1", "2", "3", "4", "5", "6"], dtype=object),
    "cell": np.array([1.0, "a", None, [1], {"a": 1}, 2], dtype=object),
    "struct": {"a": 1.0, "b": {"c": RISING}},
    "sparse": scipy.sparse.csc_matrix(np.eye(1, 6)),
    "logical": np.array([True, False] * 3),
    "nan": np.full(6, np.nan),
    "short": np.arange(3.0),
    "large": np.full(6, 2**64 - 1, dtype=np.uint64),
}


@st.composite
def files(draw: st.DrawFn) -> bytes:
    kinds = st.sampled_from(sorted(VARIABLES))
    names = {"t": draw(st.one_of(st.just("rising"), kinds)), "u": draw(kinds), "y": draw(kinds)}
    names |= draw(st.dictionaries(st.sampled_from(["a", "ans", "T", "x1"]), kinds, max_size=2))
    out = io.BytesIO()
    form = draw(st.sampled_from(["5", "5", "4"]))
    wanted = {name: VARIABLES[kind] for name, kind in names.items()}
    try:
        scipy.io.savemat(out, wanted, format=form, do_compression=draw(st.booleans()) and form == "5")
    except (ValueError, TypeError, AttributeError, NotImplementedError):
        out = io.BytesIO(b"MATLAB 5.0 MAT-file")
    data = out.getvalue()
    return draw(st.one_of(st.just(data), bytewise(data)))


def _element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)


def bomb(samples: int) -> bytes:
    """A variable y of zeros, deflated piece by piece: a thousandth of what it holds."""
    flags = _element(6, struct.pack("<II", 6, 0))
    shape = _element(5, struct.pack("<ii", 1, samples))
    head = flags + shape + _element(1, b"y") + struct.pack("<II", 9, 8 * samples)
    packer = zlib.compressobj(9)
    packed = packer.compress(struct.pack("<II", 14, len(head) + 8 * samples) + head)
    zeros, left = bytes(1 << 24), 8 * samples
    while left > 0:
        packed += packer.compress(zeros[: min(left, len(zeros))])
        left -= len(zeros)
    packed += packer.flush()
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return header + struct.pack("<II", 15, len(packed)) + packed


def bombs() -> list[bytes]:
    """Megabytes that are gigabytes when read."""
    return [bomb(200_000_000)]


strategy = files()


def prepare(oracle: Oracle, folder: Path) -> Any:
    """The file as a record of a model."""
    return lambda given: read(oracle, folder / "run.mat", given)
