"""Where a fit begins: the first states of every run, the path they lead along, and the states an effect brings."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from suite import expressions
from suite.discovery.engine import Problem
from suite.discovery.frame import Point
from suite.discovery.noise import unrolled
from suite.discovery.terms import Term
from suite.errors import DataError, ModelError
from suite.kernels.integrate import FINEST
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

FASTEST = 2.7 * FINEST  # rate times step at which the finest parts of a step still keep a decaying state bounded (RK4)
NEAR = 10.0  # ranges of an output: while a simulation is no farther from the data, its states are the plant's
LOOKS = 100  # samples before it goes farther, at which its rates are looked at


def check_record(model: Model, record: Record) -> None:
    """Raise DataError where a record cannot be used with a model."""
    if record.y.shape[1] != len(model.outputs) or record.u.shape[1] != len(model.inputs):
        raise DataError(
            f"{record.source}: expected {len(model.outputs)} outputs and {len(model.inputs)} inputs as in the model, "
            f"got {record.y.shape[1]} and {record.u.shape[1]}; read it with this model"
        )
    unknown = sum(p.prior_sd > 0 for p in model.parameters.values())
    open_states = [s for s in model.states if s not in model.initial or model.initial[s].estimate]
    first = len(open_states) * len(record.starts)
    count = int((~np.isnan(record.y)).sum())
    if count < unknown + first + 2:
        raise DataError(
            f"{record.source}: {count} measurements cannot determine {unknown} parameters and {first} initial states; "
            "add data or fix parameters"
        )


def check_stiffness(problem: Problem) -> None:
    """Raise ModelError where a simulation explodes because a state is too fast for the record's steps.

    Where it left the finite numbers, and a state decayed or swung too fast while it was still near the data, that is an
    explosion of the integration. One that grows is the model's own.
    """
    model, record = problem.model, problem.record
    passed, dt = problem.run(problem.start, 0.0), float(np.median(record.dt))
    if passed.finite:
        return
    read = ~np.isnan(record.y).all(axis=0)
    low, high = np.nanmin(record.y[:, read], axis=0), np.nanmax(record.y[:, read], axis=0)
    with np.errstate(invalid="ignore", over="ignore"):
        near = (np.abs(passed.Y[:, read] - 0.5 * (low + high)) <= NEAR * (high - low)).all(axis=1)
    near &= np.isfinite(passed.X).all(axis=1)
    end = len(near) if near.all() else int(np.argmin(near))
    for k in range(max(end - LOOKS, 0), end):
        F = model.jacobian(float(record.t[k]), passed.X[k], record.u[k])
        if not np.isfinite(F).all():
            continue
        values = np.linalg.eigvals(F)
        fastest = values[np.argmax(np.abs(values))]
        if abs(fastest) * dt > FASTEST and fastest.real <= 0.5 * abs(fastest):
            name = list(model.states)[int(np.argmax(np.abs(np.diag(F)) + np.sqrt(np.abs(F * F.T)).sum(axis=1)))]
            raise ModelError(
                f"{model.source}, [states] {name}: too fast for these data; its rate is {abs(fastest):.3g} a unit of "
                f"time and a step of the data {dt:.3g}, expected at most {FASTEST / dt:.3g}; put the value at which it "
                "settles into the other equations in its place, or give data at finer steps"
            )


def first_states(model: Model, record: Record) -> tuple[Array, npt.NDArray[np.bool_]]:
    """A start for each run's first state, (runs, n), and which of its components are estimated, (n,)."""
    names = list(model.states)
    x0 = np.zeros((len(record.starts), len(names)))
    free = np.ones(len(names), dtype=bool)
    measured = {output.equation.strip(): j for j, output in enumerate(model.outputs.values())}
    for i, name in enumerate(names):
        given = model.initial.get(name)
        if given is not None:
            x0[:, i] = given.value
            # The pieces of an excerpt begin wherever the plant then was.
            free[i] = given.estimate or record.whole is not None
            if record.whole is None:
                continue
        position = next((p for p in model.definitions if model.states[p].strip() == name), None)
        for r, run in enumerate(record.runs):
            own = measured.get(name, measured.get(position or ""))
            if own is None:
                continue
            y = unrolled(run, own, list(model.outputs.values())[own].angle)
            there = ~np.isnan(y)
            t, y = run.t[there][:6], y[there][:6]
            if name in measured:
                x0[r, i] = y[0] if len(y) else 0.0
            elif len(y) > 1:
                x0[r, i] = np.polyfit(t - t[0], y, 1)[0]
    return x0, free


def rough_path(problem: Problem) -> Array:
    """States at the samples before anything is fitted: measured where they are, integrated elsewhere."""
    model, record = problem.model, problem.record
    path = problem.run(problem.start, 0.0).X.copy()
    for i, name in enumerate(model.states):
        for j, output in enumerate(model.outputs.values()):
            if output.equation.strip() == name:
                path[:, i] = np.concatenate([unrolled(run, j, output.angle) for run in record.runs])
    for i, name in enumerate(model.states):
        position = next((p for p in model.definitions if model.states[p].strip() == name), None)
        if position is not None and not np.isfinite(path[:, i]).all():
            path[:, i] = np.gradient(path[:, list(model.states).index(position)], record.t)
    return path


def pace_of(model: Model, record: Record, path: Array) -> Array:
    """How fast each state moves along the path, its rate's standard deviation, (n,); zero for definitions."""
    pace = np.zeros(len(model.states))
    bounds = record.bounds
    for i, name in enumerate(model.states):
        if name not in model.suspects:
            continue
        slopes = []
        for first, last in pairwise(bounds.tolist()):
            good = np.isfinite(path[first:last, i])
            if good.sum() > 2:
                slopes.append(np.gradient(path[first:last, i][good], record.t[first:last][good]))
        all_slopes = np.concatenate(slopes) if slopes else np.zeros(1)
        pace[i] = float(np.sqrt(np.mean(all_slopes**2)))
        if not np.isfinite(pace[i]) or pace[i] == 0.0:
            pace[i] = 1.0 / max(float(record.t[-1] - record.t[0]), 1e-300)
    return pace


def start_of(problem: Problem, term: Term) -> Array:
    """A candidate's parameters before it is fitted: coefficients zero, inner scales in the middle of their range."""
    inner = []
    for name, entry in term.inner.items():
        zero, unit = problem.unit(term, name)
        inner.append(zero + entry.start * unit)
    return np.array([0.0] * len(term.coefficients) + inner)


def brought(problem: Problem, point: Point, k: int) -> Point:
    """The point with the first values of candidate k's states, from each run's first state, input and parameters."""
    term = problem.terms[k]
    if not any(start != "0" for _, start, _ in term.states.values()):
        return point
    model, record = problem.model, problem.record
    names = (*model.states, *model.parameters, *model.inputs, *term.names, "t")
    x0 = point.x0.copy()
    count = len(model.parameters)
    for r, first in enumerate(record.starts):
        values = [*x0[r, : len(model.states)], *point.p[:count], *record.u[first], *point.p[problem.places(k)],
                  record.t[first]]  # fmt: skip
        for place, (_, text, _) in zip(problem.states(k), term.states.values(), strict=True):
            x0[r, place] = _function(text, names)(*values)
    return Point(x0, point.p)


@lru_cache(maxsize=512)
def _function(text: str, names: tuple[str, ...]) -> Callable[..., float]:
    """A text as a function of the named values."""
    expression = expressions.parse(text, set(names) - {expressions.TIME}, "first value of an added state")
    compiled: Callable[..., Any] = sympy.lambdify([expressions.symbol(name) for name in names], expression, "math")
    return compiled
