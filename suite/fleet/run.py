"""The run over a fleet: what a file's row depends on, and the tasks of the files that are new or changed."""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import suite
from suite import plugins
from suite.benchmark import hashes
from suite.benchmark.cells import Cell
from suite.benchmark.driving import Driving, drive
from suite.benchmark.reservations import Reservations
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task
from suite.fleet import one
from suite.fleet.stored import Brief
from suite.fleet.stored import briefs as stored_briefs
from suite.model import Model
from suite.model_file import to_toml


@dataclass(frozen=True)
class Asked:
    """What is asked of every file: the model (and the name of its file), and whether absolute states may act."""

    model: Model
    source: str
    absolute: bool = False


class Keys:
    """The keys of files: of the model, the library, the version, --absolute, and a file's place and bytes."""

    def __init__(self, asked: Asked) -> None:
        texts = sorted((path.name, path.read_text(encoding="utf-8")) for path in hashes.finding())
        effects = sorted(map(repr, plugins.effects().values()))
        self.common = _digest(to_toml(asked.model), texts, effects, suite.__version__, asked.absolute)

    def place(self, path: str) -> str:
        """The key of a file whatever is in it: what a run takes in hand."""
        return _digest(self.common, path)

    def of(self, path: str, digest: str) -> str:
        """The key of a file with these bytes."""
        return _digest(self.common, path, digest)


def unfinished(key: str, how: Driving) -> str:
    """The key under which a file that met a limit is stored."""
    return f"{key} {how.limit:g} {how.memory:g}"


def finished(stored: str | None, key: str, how: Driving) -> bool:
    """Whether what is stored stands: a row that met a limit stands until a limit is wider."""
    if stored is None or stored == key:
        return stored == key
    rest = stored.removeprefix(key).split()
    return stored.startswith(f"{key} ") and how.limit <= float(rest[0]) and how.memory <= float(rest[1])


@dataclass(frozen=True)
class Done:
    """How many files were run and how many were stored before, and what ranks them, in no order."""

    run: int
    unchanged: int
    briefs: list[Brief]


def run(files: Mapping[str, str], asked: Asked, store: Store, how: Driving) -> Done:
    """Run the files (see `files.chosen`) that are new or changed, or all with `force`.

    Only files that have a row are read here, to see if they are what they were; all others are read where they run.
    """
    since = time.time() if how.force else 0.0
    keys, text = Keys(asked), to_toml(asked.model)
    # The keys of the rows that were asked for.
    good: dict[str, str] = {}

    def stands(path: str, kept: str | None) -> bool:
        if kept is not None and kept == good.get(path):
            return True
        if kept is None or not finished(kept, keys.of(path, one.digest(path)), how):
            return False
        good[path] = kept
        return True

    stored = {} if since else {cell.case: key for cell, key in store.keys().items()}
    fresh = [path for path in files if not stands(path, stored.get(path))]
    del stored
    statuses: Counter[str] = Counter()

    def task(path: str) -> Task | None:
        # Another run may have done it meanwhile.
        if stands(path, store.key(_cell(path), since)):
            return None
        return Task("suite.fleet.one:run", (text, asked.source, path, asked.absolute), path)

    def keep(done: Task, outcome: Any) -> tuple[str, str]:
        path = done.label
        if isinstance(outcome, Failure):
            outcome = {**dict.fromkeys(one.TEXTS, ""), "status": outcome.status, "reason": outcome.reason}
            good[path] = unfinished(keys.of(path, one.digest(path)), how)
        else:
            # A file that was written to meanwhile is stored as what was read.
            good[path] = keys.of(path, outcome.pop("digest"))
        store.put(_cell(path), good[path], outcome)
        statuses[outcome["status"]] += 1
        return keys.place(path), Path(path).name

    with Reservations(store) as held:
        drive("files", [(keys.place(path), partial(task, path)) for path in fresh], held, how, keep)
    return Done(statuses.total(), len(files) - statuses.total(), stored_briefs(store, files, stands))


def _cell(path: str) -> Cell:
    return Cell(path, 0.0, "diagnose", "each", 0)


def _digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]
