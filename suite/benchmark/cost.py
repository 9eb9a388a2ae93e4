"""What a step costs: run time against the number of states and against the length of the record.

The plant is a chain of masses (two states each) with at most five positions measured, so that the arithmetic grows
with the states alone; the length is varied on one mass.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cases.chain_small import chain
from suite import plugins
from suite.benchmark import pool
from suite.benchmark.worker import Failure, Task
from suite.case import Case, Experiment
from suite.excitation import multisine
from suite.model import Initial, Model
from suite.prior import default_prior
from suite.record import Record

STATES = (2, 4, 10, 20, 40, 100)
LENGTHS = (100, 1_000, 10_000, 100_000, 1_000_000)
SAMPLES = 200  # of the records of growing models
SENSORS = 5
DT = 0.1
BUDGET = 10.0  # seconds: what follows a size that took longer is left out, with that as its reason
REPEATED = 0.5  # seconds: what is quicker is timed three times, and the least counts
LIMIT, MEMORY = 300.0, 2048.0  # seconds and MiB of one method's series
AXES = {"states": STATES, "samples": LENGTHS}


def measure(
    names: Sequence[str] | None = None, progress: Callable[[str], None] = lambda _: None
) -> list[dict[str, Any]]:
    """A row a method and size: {"estimator", "axis", "states", "samples", "status", "reason", "seconds", "step_us"}.

    One process, so that no two runs share a core's time; a method that hangs or eats memory loses its series.
    """
    chosen = list(plugins.estimators()) if names is None else list(names)
    tasks = [Task("suite.benchmark.cost:series", (name, axis), (name, axis)) for name in chosen for axis in AXES]
    rows: list[dict[str, Any]] = []
    for task, outcome in pool.run(tasks, 1, LIMIT, MEMORY):
        name, axis = task.label
        if isinstance(outcome, Failure):
            outcome = [{"status": outcome.status, "reason": outcome.reason, "states": None, "samples": None}]
        rows += [{"estimator": name, "axis": axis, **row} for row in outcome]
        progress(f"{name} against {axis}")
    return rows


def series(name: str, axis: str) -> list[dict[str, Any]]:
    """One method's rows along an axis, from the smallest size until one takes longer than the budget."""
    estimator = plugins.estimators()[name]
    rows: list[dict[str, Any]] = []
    reason = ""
    for states, samples in _sizes(axis):
        row: dict[str, Any] = {"states": states, "samples": samples, "seconds": None, "step_us": None, "reason": reason}
        if reason:
            rows.append({**row, "status": "left out"})
            continue
        model, record = plant(states, samples)
        refusal = estimator.skip(model, record)
        if refusal is not None:
            rows.append({**row, "status": "skipped", "reason": refusal})
            continue
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                # Compiling is no cost of a step.
                estimator.estimate(model, record.part(0, 12))
                seconds = _least(partial(estimator.estimate, model, record))
            except Exception as error:  # a method may fail in any way; that is its result here
                rows.append({**row, "status": "error", "reason": f"{type(error).__name__}: {error}"})
                continue
        rows.append({**row, "status": "ok", "seconds": seconds, "step_us": 1e6 * seconds / samples})
        if seconds > BUDGET:
            reason = f"{states} states and {samples} samples took {seconds:.0f} s"
    return rows


def plant(states: int, samples: int) -> tuple[Model, Record]:
    """A chain with so many states and its record, noise 5 %, with the prior that every method gets."""
    masses = states // 2
    seen = sorted({round(k) for k in np.linspace(1, masses, min(masses, SENSORS))})
    model = chain(masses, tuple(seen))
    # Estimated first states: from an exactly known rest covariances grow out of numbers below 1e-300, which processors
    # are slow at.
    model = replace(model, initial={name: Initial(0.0, estimate=True) for name in model.states})
    force = {"F": multisine(3.0, 0.05, 0.8, 16)}
    case = Case("cost", "", model, model, Experiment((samples - 1) * DT, DT, (0.0,) * states, force))
    record, truth = case.simulate(0.05, 0)
    return model, record.with_prior(default_prior(model, record, truth.noise))


def _sizes(axis: str) -> Iterator[tuple[int, int]]:
    sizes = [(n, SAMPLES) for n in STATES] if axis == "states" else [(2, samples) for samples in LENGTHS]
    yield from sizes


def _least(run: Callable[[], object]) -> float:
    """Seconds of a run; of the quickest of three where it is short."""
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        run()
        taken.append(time.perf_counter() - start)
        if taken[-1] > REPEATED:
            break
    return min(taken)
