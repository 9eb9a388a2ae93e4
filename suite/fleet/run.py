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
from suite.model import Model
from suite.model_file import to_toml

# What identifies a stored row; "noise" is there the noise level of a cell of the benchmark.
IDENTITY = ("case", "noise", "estimator", "variant", "seed", "key", "when")


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
    """How many files were run and how many were stored before, and the rows of all of them."""

    run: int
    unchanged: int
    rows: list[dict[str, Any]]


def run(files: Mapping[str, str], asked: Asked, store: Store, how: Driving) -> Done:
    """Run the files (see `files.chosen`) that are new or changed, or all with `force`."""
    since = time.time() if how.force else 0.0
    keys, text = Keys(asked), to_toml(asked.model)
    wanted = {path: keys.of(path, one.digest(path)) for path in files}
    stored = {} if since else {cell.case: key for cell, key in store.keys().items()}
    fresh = [path for path, key in wanted.items() if not finished(stored.get(path), key, how)]
    statuses: Counter[str] = Counter()

    def task(path: str) -> Task | None:
        if finished(store.key(_cell(path), since), wanted[path], how):
            return None
        return Task("suite.fleet.one:run", (text, asked.source, path, asked.absolute), path)

    def keep(done: Task, outcome: Any) -> tuple[str, str]:
        path, taken = done.label, wanted[done.label]
        if isinstance(outcome, Failure):
            outcome = {**dict.fromkeys(one.TEXTS, ""), "status": outcome.status, "reason": outcome.reason}
            key = unfinished(taken, how)
        else:
            # A file that was written to meanwhile is stored as what was read.
            key = wanted[path] = keys.of(path, outcome.pop("digest"))
        store.put(_cell(path), key, outcome)
        statuses[outcome["status"]] += 1
        return taken, Path(path).name

    with Reservations(store) as held:
        drive("files", [(wanted[path], partial(task, path)) for path in fresh], held, how, keep)
    return Done(statuses.total(), len(files) - statuses.total(), _rows(files, wanted, store, how))


def _rows(files: Mapping[str, str], wanted: Mapping[str, str], store: Store, how: Driving) -> list[dict[str, Any]]:
    """The rows of these files as they are, under the names that they were given; not what else the store holds."""
    found = []
    for row in store.rows():
        path = row["case"]
        if path in files and finished(row["key"], wanted[path], how):
            noise = {"noise": row["noise"]} if row["status"] == "ok" else {}
            found.append({"file": files[path], **{k: v for k, v in row.items() if k not in IDENTITY}, **noise})
    return found


def _cell(path: str) -> Cell:
    return Cell(path, 0.0, "diagnose", "each", 0)


def _digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]
