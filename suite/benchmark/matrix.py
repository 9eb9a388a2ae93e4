"""Run a plan: tune what must be tuned, run the cells that are new or changed, commit each as it finishes."""

from __future__ import annotations

import contextlib
import fnmatch
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numba
import numpy as np

import suite
from suite import plugins
from suite.benchmark import grids, tuning
from suite.benchmark.cells import Cell
from suite.benchmark.driving import Driving, drive
from suite.benchmark.hashes import Keys
from suite.benchmark.plan import Plan
from suite.benchmark.recovery import recovers
from suite.benchmark.references import VARIANT
from suite.benchmark.reservations import Reservations
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task
from suite.errors import DataError, InputError


def chosen(
    plan: Plan, only: str | None, seeds: int | None, data: Path | None, estimators: Sequence[str] | None = None
) -> list[Cell]:
    """The cells of a plan whose label holds `only` (shell patterns match the whole label); `estimators` and `seeds`
    take the place of the plan's.
    """
    if seeds is not None:
        plan = replace(plan, seeds=seeds)
    if estimators:
        plan = replace(plan, estimators=tuple(estimators))
    cells = plan.cells(_runs(data))
    if only is not None:
        pattern = only if any(sign in only for sign in "*?[") else f"*{only}*"
        cells = [cell for cell in cells if fnmatch.fnmatchcase(cell.label, pattern)]
        if not cells:
            raise InputError(
                f"no cell of plan {plan.name!r} is like {only!r}; `bench list --plan {plan.name}` lists them"
            )
    return cells


def _runs(data: Path | None) -> dict[str, int]:
    """How many runs each measured case has; one where the data are absent (its row says so)."""
    runs = {}
    for name, case in plugins.cases().items():
        if case.measured is not None:
            try:
                runs[name] = len(case.measured(data).starts)
            except DataError:
                runs[name] = 1
    return runs


@dataclass(frozen=True)
class Running(Driving):
    """How cells are run; `tuned_at` and `tuned_as` as in a plan."""

    data: Path | None = None
    tuned_at: float | None = None
    tuned_as: Mapping[str, str] = field(default_factory=dict)


def run(cells: Sequence[Cell], store: Store, how: Running, *, tune_only: bool = False) -> dict[str, Any]:
    """Run what is not in the store yet (or all, with `force`); counts by status, and how many were still good."""
    keys, since = Keys(how.data, how.tuned_at, how.tuned_as), time.time() if how.force else 0.0
    stored = {} if how.force else store.keys()
    fresh = [cell for cell in cells if tune_only or stored.get(cell) != keys.cell(cell)]
    with Reservations(store) as held:
        tuned = _tune(fresh, store, keys, how, held, since)
        if tune_only:
            return {"tuned": tuned}
        # Cells of one case and estimator follow each other, so that a process warms up once for many.
        fresh.sort(key=lambda cell: (cell.case, cell.estimator, cell.noise, cell.variant, cell.seed))

        def task(cell: Cell) -> Task | None:
            if store.key(cell, since) == keys.cell(cell):
                return None
            values: Mapping[str, Any] = grids.values(cell.variant)
            if cell.variant == "tuned":
                found = store.tuning(keys.tuning(cell.case, cell.noise, cell.estimator))
                values = found["values"] if found else {}
            module = "recovery" if recovers(cell) else "cells"
            return Task(f"suite.benchmark.{module}:run", (cell, values, how.data), cell)

        statuses: Counter[str] = Counter()
        versions = _versions()

        def keep(done: Task, outcome: Any) -> tuple[str, str]:
            cell, row = done.label, outcome
            if isinstance(outcome, Failure):
                row = {"status": outcome.status, "reason": outcome.reason}
                kind = "recovery" if recovers(cell) else cell.variant
                row |= {"kind": kind} if kind in ("recovery", VARIANT) else {}
            if cell.variant == "tuned" and keys.tuner(cell.estimator) != cell.estimator:
                row["tuned_as"] = keys.tuner(cell.estimator)
            hashes = {"plugin_hash": keys.plugin(cell.estimator), "case_hash": keys.case(cell.case)}
            store.put(cell, keys.cell(cell), {**row, **hashes, "versions": versions})
            statuses[row["status"]] += 1
            return keys.cell(cell), cell.label

        drive("cells", [(keys.cell(cell), partial(task, cell)) for cell in fresh], held, how, keep)
    count = statuses.total()
    return {"cells": len(cells), "run": count, "unchanged": len(cells) - count, "status": dict(statuses)}


def _tune(cells: Sequence[Cell], store: Store, keys: Keys, how: Running, held: Reservations, since: float) -> int:
    """Find the tuned values that are not stored; where tuning failed they are {}, the defaults. How many are wanted."""
    wanted = dict.fromkeys(
        (c.case, keys.tuning_noise(c.noise), keys.tuner(c.estimator)) for c in cells if c.variant == "tuned"
    )
    by_key = {keys.tuning(*entry): entry for entry in wanted}
    fresh = {key: entry for key, entry in by_key.items() if store.tuning(key, since) is None}

    def task(key: str, entry: tuple[str, float, str]) -> Task | None:
        if store.tuning(key, since) is not None:
            return None
        return Task("suite.benchmark.tuning:tune", (*entry, how.data), key)

    def keep(done: Task, outcome: Any) -> tuple[str, str]:
        case, noise, name = fresh[done.label]
        if isinstance(outcome, Failure):
            outcome = {
                "values": {}, "failure": outcome.reason, "case": case, "noise": noise, "estimator": name
            }  # fmt: skip
        store.put_tuning(done.label, outcome)
        return done.label, f"{case} {name}"

    # Several estimates a score make a tuning long; it gets the time of as many cells.
    limit = how.limit * len(tuning.SEEDS) * tuning.EVALUATIONS
    drive("tunings", [(key, partial(task, key, entry)) for key, entry in fresh.items()], held, how, keep, limit)
    return len(by_key)


def _versions() -> dict[str, str]:
    versions = {
        "unmodelled": suite.__version__,
        "numpy": np.__version__,
        "numba": numba.__version__,
        "filterpy": version("filterpy"),
    }
    with contextlib.suppress(PackageNotFoundError):
        versions["pysindy"] = version("pysindy")
    return versions
