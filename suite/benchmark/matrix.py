"""Run a plan: tune what must be tuned, run the cells that are new or changed, commit each as it finishes."""

from __future__ import annotations

import contextlib
import fnmatch
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numba
import numpy as np

import suite
from suite import plugins
from suite.benchmark import pool, tuning
from suite.benchmark.cells import Cell
from suite.benchmark.hashes import Keys
from suite.benchmark.plan import Plan
from suite.benchmark.progress import Progress
from suite.benchmark.recovery import recovers
from suite.benchmark.store import Store
from suite.errors import DataError, InputError


def chosen(plan: Plan, only: str | None, seeds: int | None, data: Path | None) -> list[Cell]:
    """The cells of a plan whose label holds `only` (shell patterns match the whole label)."""
    if seeds is not None:
        plan = replace(plan, seeds=seeds)
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


def run(
    cells: Sequence[Cell],
    store: Store,
    *,
    jobs: int | None = None,
    limit: float = 60.0,
    data: Path | None = None,
    force: bool = False,
    tune_only: bool = False,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run what is not in the store yet (or all, with `force`); counts by status, and how many were still good."""
    keys = Keys(data)
    stored = {} if force else store.keys()
    fresh = [cell for cell in cells if tune_only or stored.get(cell) != keys.cell(cell)]
    jobs = jobs or max(1, os.cpu_count() or 1)
    # Several estimates a score make a tuning long; it gets the time of as many cells.
    tuned = _tune(fresh, store, keys, jobs, limit * 2 * tuning.EVALUATIONS, data, force=force, quiet=quiet)
    if tune_only:
        return {"tuned": len(tuned)}
    statuses: Counter[str] = Counter()
    # Cells of one case and estimator follow each other, so that a process warms up once for many.
    fresh.sort(key=lambda cell: (cell.case, cell.estimator, cell.noise, cell.variant, cell.seed))
    tasks = []
    for cell in fresh:
        values = tuned[keys.tuning(cell.case, cell.noise, cell.estimator)] if cell.variant == "tuned" else {}
        module = "recovery" if recovers(cell) else "cells"
        tasks.append(pool.Task(f"suite.benchmark.{module}:run", (cell, values, data), cell))
    versions = _versions()
    with Progress("cells", len(tasks), quiet=quiet) as progress:
        for task, outcome in pool.run(tasks, jobs, limit):
            cell, row = task.label, outcome
            if isinstance(outcome, pool.Failure):
                row = {"status": "time-out" if outcome.status == "time-out" else "error", "reason": outcome.reason}
                row |= {"kind": "recovery"} if recovers(cell) else {}
            hashes = {"plugin_hash": keys.plugin(cell.estimator), "case_hash": keys.case(cell.case)}
            store.put(cell, keys.cell(cell), {**row, **hashes, "versions": versions})
            statuses[row["status"]] += 1
            progress.step(cell.label)
    return {"cells": len(cells), "run": len(tasks), "unchanged": len(cells) - len(tasks), "status": dict(statuses)}


def _tune(
    cells: Sequence[Cell],
    store: Store,
    keys: Keys,
    jobs: int,
    limit: float,
    data: Path | None,
    *,
    force: bool,
    quiet: bool,
) -> dict[str, dict[str, float]]:
    """Tuned values by tuning key, from the store or found now; {} (the defaults) where tuning failed."""
    wanted = {(c.case, c.noise, c.estimator): None for c in cells if c.variant == "tuned"}
    by_key = {keys.tuning(*entry): entry for entry in wanted}
    found: dict[str, dict[str, float]] = {}
    tasks = []
    for key, entry in by_key.items():
        known = None if force else store.tuning(key)
        if known is None:
            tasks.append(pool.Task("suite.benchmark.tuning:tune", (*entry, data), key))
        else:
            found[key] = known["values"]
    with Progress("tunings", len(tasks), quiet=quiet) as progress:
        for task, outcome in pool.run(tasks, jobs, limit):
            if isinstance(outcome, pool.Failure):
                outcome = {"values": {}, "failure": outcome.reason}
            store.put_tuning(task.label, outcome)
            found[task.label] = outcome["values"]
            progress.step(f"{by_key[task.label][0]} {by_key[task.label][2]}")
    return found


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
