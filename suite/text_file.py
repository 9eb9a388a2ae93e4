"""The text of a table's file, read in pieces: what is no table is refused before memory is spent on it."""

from __future__ import annotations

import codecs
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from suite.errors import DataError

LARGEST = 1 << 30  # bytes of a file
PIECE = 1 << 20  # bytes read at a time, in which a line must end


@dataclass(frozen=True)
class Text:
    """A file that is text throughout, and its encoding."""

    file: Path
    encoding: str

    def opened(self) -> TextIO:
        """The text from its beginning, its line ends made alike."""
        return self.file.open(encoding=self.encoding)


def text_of(file: Path) -> Text:
    """The text in a file: UTF-8, UTF-16 with or without a mark, or Latin-1. Nothing of it is kept. Raises DataError."""
    if file.stat().st_size > LARGEST:
        raise DataError(f"{file.name}: larger than 1 GB; split it into several files, or save it as parquet")
    encoding, ends, zeros, decoder = "", 0, False, None
    with file.open("rb") as handle:
        piece = b"first"
        while piece:
            piece = handle.read(PIECE)
            if not encoding:
                encoding = _encoding(piece)
                decoder = codecs.getincrementaldecoder(encoding)()
            zeros = zeros or b"\0" in piece
            if encoding == "utf-8-sig" and zeros:
                raise _no_text(file)
            if len(piece) == PIECE and b"\n" not in piece and b"\r" not in piece:
                raise DataError(f"{file.name}, line {1 + ends}: longer than 1 MB; put each sample on a line of its own")
            ends += piece.count(b"\n")
            try:
                # Nothing more to read ends the last letter.
                if decoder is not None and "\0" in decoder.decode(piece, final=not piece):
                    raise _no_text(file)
            except UnicodeDecodeError:
                decoder = None
    if decoder is None:
        # Every byte is a letter of Latin-1.
        if zeros:
            raise _no_text(file)
        encoding = "latin-1"
    return Text(file, encoding)


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
