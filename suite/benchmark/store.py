"""Results in one SQLite file: each finished cell is committed at once, so that a killed run loses nothing."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from suite.benchmark.cells import Cell
from suite.errors import InputError

DEFAULT = Path("unmodelled-bench.sqlite")
TABLES = """
CREATE TABLE IF NOT EXISTS cells (
    "case" TEXT, noise REAL, estimator TEXT, variant TEXT, seed INTEGER, key TEXT NOT NULL, row TEXT NOT NULL,
    "when" REAL NOT NULL, PRIMARY KEY ("case", noise, estimator, variant, seed));
CREATE TABLE IF NOT EXISTS tunings (key TEXT PRIMARY KEY, "values" TEXT NOT NULL, "when" REAL NOT NULL);
"""


class Store:
    """The rows of a matrix, newest for each cell, and the tuned values; several processes may write at once."""

    def __init__(self, path: Path, *, must_exist: bool = False) -> None:
        if must_exist and not path.is_file():
            raise InputError(f"no results in {path}; make them with: unmodelled bench run --store {path}")
        try:
            # WAL: readers go on while another process writes; a writer waits for its turn up to a minute.
            self.connection = sqlite3.connect(path, timeout=60.0, isolation_level=None)
            self.connection.execute("PRAGMA journal_mode=WAL")
            self.connection.execute("PRAGMA synchronous=NORMAL")
            self.connection.executescript(TABLES)
        except sqlite3.Error as error:
            raise InputError(f"{path}: cannot be used as a store of results ({error}); name another file") from None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.connection.close()

    def keys(self) -> dict[Cell, str]:
        """The key of each stored cell: a cell whose key is unchanged need not run again."""
        rows = self.connection.execute('SELECT "case", noise, estimator, variant, seed, key FROM cells')
        return {Cell(*row[:5]): row[5] for row in rows}

    def put(self, cell: Cell, key: str, row: Mapping[str, Any]) -> None:
        """Commit a finished cell in place of an older row of it."""
        values = (cell.case, cell.noise, cell.estimator, cell.variant, cell.seed, key, json.dumps(row), time.time())
        self.connection.execute("INSERT OR REPLACE INTO cells VALUES (?,?,?,?,?,?,?,?)", values)

    def rows(self) -> list[dict[str, Any]]:
        """Every stored row, flat, in the order of the cells."""
        order = '"case", noise, estimator, variant, seed'
        found = self.connection.execute(f'SELECT {order}, key, row, "when" FROM cells ORDER BY {order}')
        names = ("case", "noise", "estimator", "variant", "seed", "key")
        return [{**dict(zip(names, r, strict=False)), **json.loads(r[6]), "when": r[7]} for r in found]

    def tuning(self, key: str) -> dict[str, Any] | None:
        """Tuned values under a key, or None."""
        found = self.connection.execute('SELECT "values" FROM tunings WHERE key = ?', (key,)).fetchone()
        return None if found is None else dict(json.loads(found[0]))

    def put_tuning(self, key: str, values: Mapping[str, Any]) -> None:
        """Commit tuned values."""
        row = (key, json.dumps(values), time.time())
        self.connection.execute("INSERT OR REPLACE INTO tunings VALUES (?,?,?)", row)
