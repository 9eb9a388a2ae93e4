"""Merge stores: the newest row of each cell and the newest tuned values, from any number of files."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from suite.benchmark.store import CELL, Store, check_schema
from suite.errors import InputError


def collect(store: Store, paths: Sequence[Path]) -> dict[str, int]:
    """Merge the files into the store, all or none; how many rows and tunings were new or newer.

    InputError names the file that is missing, broken or of another schema; the store is then as it was.
    """
    taken = {"cells": 0, "tunings": 0}
    with store.transaction():
        for path in paths:
            if not path.is_file():
                raise InputError(f"no results in {path}; give files that `bench run --store` has written")
            try:
                other = sqlite3.connect(f"file:{quote(str(path))}?mode=ro", uri=True, timeout=60.0)
                try:
                    _merge(store, other, path, taken)
                finally:
                    other.close()
            except sqlite3.Error as error:
                raise InputError(f"{path}: not a readable store of results ({error}); nothing was collected") from None
    return taken


def _merge(store: Store, other: sqlite3.Connection, path: Path, taken: dict[str, int]) -> None:
    check_schema(other, path)
    (sound,) = other.execute("PRAGMA quick_check(1)").fetchone()
    if sound != "ok":
        raise InputError(f"{path}: the file is damaged ({sound}); nothing was collected")
    for table, key, columns in (("cells", CELL, ("key", "row")), ("tunings", "key", ("values",))):
        names = ", ".join((key, *(f'"{name}"' for name in columns), '"when"'))
        marks = ", ".join("?" * (names.count(",") + 1))
        news = ", ".join(f'"{name}" = excluded."{name}"' for name in (*columns, "when"))
        for row in other.execute(f"SELECT {names} FROM {table}"):
            done = store.execute(
                f"INSERT INTO {table} ({names}) VALUES ({marks}) "
                f'ON CONFLICT ({key}) DO UPDATE SET {news} WHERE excluded."when" > {table}."when"',
                row,
            )
            taken[table] += done.rowcount
