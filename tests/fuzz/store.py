"""Stores of results: databases of others, damaged pages, rows that are not what a row is."""

from __future__ import annotations

import random
import sqlite3
from pathlib import Path
from typing import Any

from hypothesis import strategies as st
from mutations import words
from oracle import Oracle

from suite.benchmark.cells import Cell
from suite.benchmark.store import Store

ROWS = (
    "{}",
    "[]",
    "null",
    "1",
    "",
    "{",
    '{"status": 1}',
    '{"status": "ok", "tuning": 3}',
    "\0",
    '{"case": []}',
    "[" * 5000,
    "NaN",
)
PLACES = ("row", "key", '"case"', "noise", "estimator", "variant", "seed", '"when"')


@st.composite
def changes(draw: st.DrawFn) -> tuple[str, Any]:
    match draw(st.sampled_from(["bytes", "bytes", "row", "schema"])):
        case "bytes":
            return "bytes", draw(st.randoms(use_true_random=False)).getrandbits(32)
        case "row":
            value = st.one_of(
                st.sampled_from(ROWS), words, st.none(), st.binary(max_size=5), st.integers(-5, 5), st.floats()
            )
            return f"UPDATE cells SET {draw(st.sampled_from(PLACES))} = ?", draw(value)
        case _:
            return draw(st.sampled_from([
                "DROP TABLE cells", "DROP TABLE tunings", "PRAGMA user_version=99", "PRAGMA user_version=-1",
                "ALTER TABLE cells RENAME COLUMN row TO other", "DELETE FROM cells", "CREATE TABLE x (y)",
                "CREATE VIEW w AS SELECT 1", "DROP TABLE runs",
            ])), None  # fmt: skip


strategy = st.one_of(changes(), st.tuples(st.just("noise"), st.binary(max_size=200)))


def prepare(oracle: Oracle, folder: Path) -> Any:
    """Open the store, and read all of it."""
    sound = folder / "sound.sqlite"
    with Store(sound) as store:
        for seed in range(3):
            row = {"status": "ok", "tuning": {}, "state_nrmse": 0.5, "reason": None, "case_hash": None}
            store.put(Cell("paper-cubic", 0.05, "ekf", "default", seed), "k", row)
        store.put_tuning("k", {"q_scale": 1.0})
        store.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    data = sound.read_bytes()
    path = folder / "given.sqlite"
    beside = (path, Path(f"{path}-wal"), Path(f"{path}-shm"), Path(f"{path}-journal"))

    def read() -> None:
        with Store(path, must_exist=True) as store:
            store.keys(), store.tuning("k"), store.rows()

    def attempt(given: tuple[str, Any]) -> None:
        kind, value = given
        for file in beside:
            file.unlink(missing_ok=True)
        path.write_bytes(value if kind == "noise" else _damaged(data, value) if kind == "bytes" else data)
        if kind not in ("noise", "bytes"):
            connection = sqlite3.connect(path, isolation_level=None)
            try:
                connection.execute(kind, () if value is None and "?" not in kind else (value,))
            except (sqlite3.Error, UnicodeEncodeError):
                return
            finally:
                connection.close()
        oracle.check(read, repr(given), *beside)

    return attempt


def _damaged(data: bytes, seed: int) -> bytes:
    """Some bytes of it changed, or the end missing."""
    chance, given = random.Random(seed), bytearray(data)
    for _ in range(chance.randint(1, 8)):
        given[chance.randrange(len(given))] = chance.randrange(256)
    return bytes(given[: chance.randrange(len(given))] if chance.random() < 0.3 else given)
