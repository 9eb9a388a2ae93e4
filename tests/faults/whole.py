"""Whether every file of a folder is whole: read to its end by what reads its kind."""

from __future__ import annotations

import csv
import hashlib
import json
import pickletools
import sqlite3
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from contextlib import closing
from html.parser import HTMLParser
from pathlib import Path

import pyarrow.parquet as pq

from suite.kernels.object_code import DIGEST

LEFT = ".tmp"


def broken(folder: Path) -> list[str]:
    """What is half written in a folder, with the reason; what is being written beside its place does not count."""
    found = []
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix != LEFT and not path.name.startswith("."):
            try:
                KINDS[path.suffix](path)
            except Exception as error:
                found.append(f"{path.relative_to(folder)}: {type(error).__name__}: {error}"[:200])
    return found


def left_behind(folder: Path) -> list[str]:
    """The files that were being written beside their place."""
    return [str(path.relative_to(folder)) for path in folder.rglob(f"*{LEFT}")]


def _store(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        (answer,) = connection.execute("PRAGMA integrity_check").fetchone()
        if answer != "ok":
            raise ValueError(answer)


def _csv(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    lengths = {len(row) for row in csv.reader(text.splitlines())}
    if len(lengths) != 1 or not text.endswith("\n"):
        raise ValueError(f"rows of {sorted(lengths)} cells")


class _Page(HTMLParser):
    ended = False

    def handle_endtag(self, tag: str) -> None:
        self.ended = tag == "html"


def _page(path: Path) -> None:
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    page.close()
    if not page.ended:
        raise ValueError("it does not end with </html>")


def _png(path: Path) -> None:
    if not path.read_bytes().endswith(b"IEND\xaeB`\x82"):
        raise ValueError("no last block")


def _text(path: Path) -> None:
    if not path.read_text(encoding="utf-8").endswith("\n"):
        raise ValueError("no end of line at its end")


def _pickles(path: Path) -> None:
    """The files of numba's cache: one pickle after another, none of them run."""
    with path.open("rb") as handle:
        while handle.peek(1):
            for _ in pickletools.genops(handle):
                pass


def _code(path: Path) -> None:
    """Object code behind its hash."""
    content = path.read_bytes()
    if hashlib.sha256(content[DIGEST:]).digest() != content[:DIGEST]:
        raise ValueError("it does not fit its hash")


KINDS: dict[str, Callable[[Path], object]] = {
    ".sqlite": _store,
    ".sqlite-wal": lambda path: None,
    ".sqlite-shm": lambda path: None,
    ".csv": _csv,
    ".html": _page,
    ".png": _png,
    ".md": _text,
    ".txt": _text,
    ".json": lambda path: json.loads(path.read_text(encoding="utf-8")),
    ".toml": lambda path: tomllib.loads(path.read_text(encoding="utf-8")),
    ".svg": lambda path: ElementTree.fromstring(path.read_text(encoding="utf-8")),
    ".nbi": _pickles,
    ".nbc": _pickles,
    ".o": _code,
    ".parquet": lambda path: pq.read_table(path, use_threads=False).validate(full=True),
}
