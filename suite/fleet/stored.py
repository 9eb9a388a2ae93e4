"""The verdicts of a fleet as they are stored: what ranks the files, all of it, and whole rows, a part at a time."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from suite.benchmark.store import Store
from suite.errors import InputError

PART = 500  # rows in memory at a time
WORDS = ("status", "reason", "verdict", "effects")


@dataclass(frozen=True, slots=True)
class Brief:
    """What ranks a file and counts it; `path` is its place in the store, `file` its name as given.

    Without a verdict `verdict` and `effects` are empty, `weight` and `ratio` (error over noise) NaN.
    """

    path: str
    file: str
    status: str
    reason: str
    verdict: str
    effects: str
    weight: float
    ratio: float


def briefs(store: Store, files: Mapping[str, str], stands: Callable[[str, str], bool]) -> list[Brief]:
    """One for each file, the name under its path; `stands` tells by path and key if a stored row is what was asked for.

    InputError where a row is none: another run has written its own over it.
    """
    found = []
    for path, key, text in _by_place(store):
        if path in files and stands(path, key):
            found.append(_brief(path, files[path], _row(store, text)))
    if lost := len(files) - len(found):
        raise InputError(
            f"{store.path}: {lost} of {len(files)} verdicts were replaced meanwhile by those of a run with another "
            f"model or other options; {store.elsewhere} for one of them"
        )
    return found


def _by_place(store: Store) -> Iterator[tuple[str, str, str]]:
    """Path, key and text of each row, in the order of the paths."""
    after = ""
    while True:
        part = store.all('SELECT "case", key, row FROM cells WHERE "case" > ? ORDER BY "case" LIMIT ?', (after, PART))
        yield from part
        if len(part) < PART:
            return
        after = part[-1][0]


def _brief(path: str, file: str, row: Mapping[str, Any]) -> Brief:
    # Few words serve many machines; each is held once.
    status, reason, verdict, effects = (sys.intern(row[name]) for name in WORDS)
    return Brief(path, file, status, reason, verdict, effects, row.get("weight", math.nan), row.get("ratio", math.nan))


def rows(store: Store, wanted: Sequence[Brief]) -> Iterator[dict[str, Any]]:
    """The whole rows of these files in this order, each with its `file`, read in parts."""
    for start in range(0, len(wanted), PART):
        part = wanted[start : start + PART]
        places = ",".join("?" * len(part))
        texts = dict(
            store.all(f'SELECT "case", row FROM cells WHERE "case" IN ({places})', [brief.path for brief in part])
        )
        for brief in part:
            yield {"file": brief.file, **_row(store, texts[brief.path])}


def _row(store: Store, text: str) -> dict[str, Any]:
    try:
        row: dict[str, Any] = json.loads(text)
        if all(isinstance(row[name], str) for name in WORDS):
            return row
    except (TypeError, ValueError, LookupError):
        pass
    raise InputError(f"{store.path}: a row is damaged ({text!r:.40}); {store.elsewhere}")
