"""The text of a table's file, read in pieces: what is no table is refused before memory is spent on it."""

from __future__ import annotations

from pathlib import Path

from suite.errors import DataError

LARGEST = 1 << 30  # bytes of a file
PIECE = 1 << 20  # bytes read at a time, in which a line must end


def read_text(file: Path) -> str:
    """A text with its line ends made alike, of UTF-8, UTF-16 with or without a mark, or Latin-1. Raises DataError."""
    if file.stat().st_size > LARGEST:
        raise DataError(f"{file.name}: larger than 1 GB; split it into several files, or save it as parquet")
    raw, encoding = bytearray(), "utf-8-sig"
    with file.open("rb") as handle:
        while piece := handle.read(PIECE):
            if not raw:
                encoding = _encoding(piece)
            if encoding == "utf-8-sig" and b"\0" in piece:
                raise _no_text(file)
            if len(piece) == PIECE and b"\n" not in piece and b"\r" not in piece:
                line = 1 + raw.count(b"\n")
                raise DataError(f"{file.name}, line {line}: longer than 1 MB; put each sample on a line of its own")
            raw += piece
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if "\0" in text:
        raise _no_text(file)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _encoding(start: bytes) -> str:
    """UTF-16 where its mark is, or where every other byte of the first letters is zero."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    even, odd = start[:32:2], start[1:32:2]
    if even and odd and not any(odd) and all(even):
        return "utf-16-le"
    return "utf-16-be" if even and odd and not any(even) and all(odd) else "utf-8-sig"


def _no_text(file: Path) -> DataError:
    return DataError(
        f"{file.name}: not a text file (it holds NUL characters); save the data as CSV in UTF-8, or give a parquet or "
        "MAT file its own suffix"
    )
