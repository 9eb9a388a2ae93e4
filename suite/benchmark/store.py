"""Results in one SQLite file: each finished cell is committed at once, so that a killed run loses nothing."""

from __future__ import annotations

import contextlib
import json
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from suite.benchmark.cells import Cell
from suite.errors import InputError

DEFAULT = Path("unmodelled-bench.sqlite")
# The layout of the file, in its user_version; 0 is the same without the number and the last two tables.
SCHEMA = 1
TABLES = """
CREATE TABLE IF NOT EXISTS cells (
    "case" TEXT, noise REAL, estimator TEXT, variant TEXT, seed INTEGER, key TEXT NOT NULL, row TEXT NOT NULL,
    "when" REAL NOT NULL, PRIMARY KEY ("case", noise, estimator, variant, seed));
CREATE TABLE IF NOT EXISTS tunings (key TEXT PRIMARY KEY, "values" TEXT NOT NULL, "when" REAL NOT NULL);
CREATE TABLE IF NOT EXISTS runs (run TEXT PRIMARY KEY, beat REAL NOT NULL);
CREATE TABLE IF NOT EXISTS taken (key TEXT PRIMARY KEY, run TEXT NOT NULL);
"""
CELL = '"case", noise, estimator, variant, seed'
# How a user says where the store is, for the sentences that ask for another place.
ATTEMPTS = 200  # to open a file that another process lays out, 50 ms apart
ELSEWHERE = "name another file with --store"


class Store:
    """The rows of a matrix, newest for each cell, and the tuned values; several processes may write at once.

    InputError where the file cannot be used or written: a full disk, a folder that cannot be written, another schema.
    """

    def __init__(self, path: Path, *, must_exist: bool = False, elsewhere: str = ELSEWHERE) -> None:
        if must_exist and not path.is_file():
            raise InputError(f"no results in {path}; make them with: unmodelled bench run --store {path}")
        self.path, self.elsewhere = path, elsewhere
        with self._in_words():
            # A writer waits for its turn up to a minute.
            self.connection = sqlite3.connect(path, timeout=60.0, isolation_level=None)
            try:
                self._open_in_turn()
            except (sqlite3.Error, InputError):
                self.connection.close()
                raise

    def _open_in_turn(self) -> None:
        """Two that lay out a new file at once: one is refused without waiting, since both hold what the other needs."""
        for _ in range(ATTEMPTS):
            try:
                return self._open()
            except sqlite3.OperationalError as error:
                if "locked" not in str(error):
                    raise
                time.sleep(0.05)
        return self._open()

    def _open(self) -> None:
        """Refuse another layout before anything is written, then lay out what is not there."""
        found = check_schema(self.connection, self.path, self.elsewhere)
        # WAL: readers go on while another process writes.
        self.connection.execute("PRAGMA journal_mode=WAL")
        self.connection.execute("PRAGMA synchronous=NORMAL")
        if found < SCHEMA:
            self.connection.executescript(f"BEGIN IMMEDIATE;{TABLES}PRAGMA user_version={SCHEMA};COMMIT;")

    @contextlib.contextmanager
    def _in_words(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise InputError(
                f"{self.path}: cannot be used as a store of results ({error}); what it holds is kept: mend what is "
                f"wrong (space, permissions) or {self.elsewhere}"
            ) from None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.connection.close()

    def execute(self, statement: str, values: Sequence[Any] = ()) -> sqlite3.Cursor:
        """One statement, committed if it writes; InputError where the file does not take it."""
        with self._in_words():
            return self.connection.execute(statement, values)

    def all(self, statement: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """What a query finds; a damaged page shows only where it is read."""
        with self._in_words():
            return self.connection.execute(statement, values).fetchall()

    @contextlib.contextmanager
    def transaction(self) -> Iterator[None]:
        """All statements inside or none."""
        self.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            # SQLite has rolled back by itself after some errors.
            if self.connection.in_transaction:
                self.connection.rollback()
            raise
        self.execute("COMMIT")

    def keys(self) -> dict[Cell, str]:
        """The key of each stored cell: a cell whose key is unchanged need not run again."""
        return {Cell(*row[:5]): row[5] for row in self.all(f"SELECT {CELL}, key FROM cells")}

    def key(self, cell: Cell, since: float = 0.0) -> str | None:
        """The key of a cell that was stored at `since` (seconds since 1970) or later, or None."""
        where = '"case" = ? AND noise = ? AND estimator = ? AND variant = ? AND seed = ? AND "when" >= ?'
        values = (cell.case, cell.noise, cell.estimator, cell.variant, cell.seed, since)
        found = self.all(f"SELECT key FROM cells WHERE {where}", values)
        return str(found[0][0]) if found else None

    def put(self, cell: Cell, key: str, row: Mapping[str, Any]) -> None:
        """Commit a finished cell in place of an older row of it."""
        values = (cell.case, cell.noise, cell.estimator, cell.variant, cell.seed, key, json.dumps(row), time.time())
        self.execute("INSERT OR REPLACE INTO cells VALUES (?,?,?,?,?,?,?,?)", values)

    def rows(self) -> list[dict[str, Any]]:
        """Every stored row, flat, in the order of the cells."""
        found = self.all(f'SELECT {CELL}, key, row, "when" FROM cells ORDER BY {CELL}')
        names = ("case", "noise", "estimator", "variant", "seed", "key")
        return [{**dict(zip(names, r, strict=False)), **self._object(r[6]), "when": r[7]} for r in found]

    def tuning(self, key: str, since: float = 0.0) -> dict[str, Any] | None:
        """Tuned values under a key, stored at `since` (seconds since 1970) or later, or None."""
        found = self.all('SELECT "values" FROM tunings WHERE key = ? AND "when" >= ?', (key, since))
        return self._object(found[0][0]) if found else None

    def _object(self, text: Any) -> dict[str, Any]:
        """What a row holds as JSON."""
        try:
            held = json.loads(text)
        except (TypeError, ValueError, RecursionError):
            held = None
        if not isinstance(held, dict):
            raise InputError(
                f"{self.path}: a row is damaged ({text!r:.40}); take a copy of the file, or {self.elsewhere}"
            )
        return held

    def put_tuning(self, key: str, values: Mapping[str, Any]) -> None:
        """Commit tuned values."""
        self.execute("INSERT OR REPLACE INTO tunings VALUES (?,?,?)", (key, json.dumps(values), time.time()))


def check_schema(connection: sqlite3.Connection, path: Path, elsewhere: str = ELSEWHERE) -> int:
    """The schema of a store that this version reads, 0 for a new file; InputError says what it is instead."""
    found = int(connection.execute("PRAGMA user_version").fetchone()[0])
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if found > SCHEMA:
        raise InputError(
            f"{path} is a store of schema {found}, this version reads up to {SCHEMA}; use a newer unmodelled for it, "
            f"or {elsewhere}"
        )
    if tables and not {"cells", "tunings"} <= tables:
        raise InputError(f"{path} is a database of something else; {elsewhere}")
    return found
