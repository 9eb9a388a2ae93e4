"""Stores can be merged, spoilt and left behind by a dead run: no row is lost."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from suite.benchmark.cells import Cell
from suite.benchmark.collect import collect
from suite.benchmark.reservations import Reservations
from suite.benchmark.store import SCHEMA, Store
from suite.errors import InputError


def _filled(path: Path, rows: dict[int, str], tunings: dict[str, float] | None = None) -> Path:
    with Store(path) as store:
        for seed, reason in rows.items():
            store.put(Cell("c", 0.0, "e", "default", seed), "key", {"status": "ok", "reason": reason})
        for key, value in (tunings or {}).items():
            store.put_tuning(key, {"values": {"alpha": value}})
    return path


def _reasons(store: Store) -> dict[int, str]:
    return {row["seed"]: row["reason"] for row in store.rows()}


def test_merged_stores_hold_the_newest_of_each(tmp_path: Path) -> None:
    """Whatever the order of the files, the newest row of each cell and the tunings of all are there."""
    old = _filled(tmp_path / "old", {0: "old", 1: "old"}, {"a": 1.0})
    mine = _filled(tmp_path / "mine", {1: "mine", 2: "mine"})
    new = _filled(tmp_path / "new", {2: "new", 3: "new"}, {"a": 2.0, "b": 3.0})
    with Store(mine) as store:
        assert collect(store, [new, old]) == {"cells": 3, "tunings": 2}
        assert _reasons(store) == {0: "old", 1: "mine", 2: "new", 3: "new"}
        assert store.tuning("a") == {"values": {"alpha": 2.0}}
        assert collect(store, [old, new, mine]) == {"cells": 0, "tunings": 0}


@pytest.mark.parametrize("spoil", ["text", "truncated", "schema", "other", "missing"])
def test_a_bad_store_is_refused_and_nothing_is_lost(tmp_path: Path, spoil: str) -> None:
    """After a good file a bad one: one sentence that names it, and the store is as it was."""
    good, mine = _filled(tmp_path / "good", {5: "good"}), _filled(tmp_path / "mine", {0: "mine"})
    bad = _filled(tmp_path / "bad", dict.fromkeys(range(500), "x" * 200))
    if spoil == "text":
        bad.write_text("not a database at all\n" * 100)
    elif spoil == "truncated":
        bad.write_bytes(bad.read_bytes()[:40960])
    elif spoil == "missing":
        bad.unlink()
    else:
        with sqlite3.connect(bad) as connection:
            connection.execute(f"PRAGMA user_version={SCHEMA + 1}" if spoil == "schema" else "DROP TABLE tunings")
        connection.close()
    with Store(mine) as store:
        with pytest.raises(InputError, match=str(bad)) as refused:
            collect(store, [good, bad])
        assert "\n" not in str(refused.value)
        assert _reasons(store) == {0: "mine"}
    if spoil != "missing" and spoil != "truncated":
        with pytest.raises(InputError, match=str(bad)):
            Store(bad)


def test_a_store_without_a_schema_is_taken_over(tmp_path: Path) -> None:
    """A file of the first layout, which had no number, keeps its rows and gets one."""
    path = _filled(tmp_path / "first", {0: "kept"})
    with sqlite3.connect(path) as connection:
        connection.executescript("DROP TABLE runs; DROP TABLE taken; PRAGMA user_version=0;")
    connection.close()
    with Store(path) as store:
        assert store.execute("PRAGMA user_version").fetchone() == (SCHEMA,)
        assert _reasons(store) == {0: "kept"}
        with Reservations(store) as held:
            assert held.take("a")


def test_a_silent_run_holds_nothing(tmp_path: Path) -> None:
    """What a run that lives has taken no other gets; what a dead one had is free."""
    path = tmp_path / "store"
    with Store(path) as store, Store(path) as other, Reservations(store) as mine, Reservations(other) as theirs:
        assert mine.take("a")
        assert not theirs.take("a")
        assert theirs.take("b")
        mine.give_back("a")
        assert theirs.take("a")
        store.execute("UPDATE runs SET beat = 0 WHERE run = ?", (theirs.run,))
        assert mine.take("a")


@pytest.mark.parametrize(("said", "waits"), [("database is locked", True), ("disk I/O error", False)])
def test_who_lays_out_a_new_store_beside_another_waits_for_its_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, waits: bool
) -> None:
    """SQLite refuses one of two that switch a new file to its log at once, without waiting; other errors stand."""
    errors = [sqlite3.OperationalError(said)] * 2
    opened = Store._open

    def open_later(store: Store) -> None:
        if errors:
            raise errors.pop()
        opened(store)

    monkeypatch.setattr(Store, "_open", open_later)
    if waits:
        assert _reasons(Store(_filled(tmp_path / "new.sqlite", {0: "kept"}))) == {0: "kept"}
    else:
        with pytest.raises(InputError, match=said):
            Store(tmp_path / "new.sqlite")


@pytest.mark.parametrize("path", ["/proc/store.sqlite", "/nowhere/store.sqlite"])
def test_a_folder_that_cannot_be_written_is_a_sentence(path: str) -> None:
    """One sentence that names the file."""
    with pytest.raises(InputError, match=path):
        Store(Path(path))
