"""What a record cannot determine: null directions of the sensitivities, by the names of parameters and first states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Pass, Problem
from suite.discovery.fit import Level, covariance
from suite.discovery.frame import Layout

Array = npt.NDArray[np.float64]

NULL = 1e-6  # of the largest singular value of the scaled sensitivities: below it a direction does not act
SAID = 2  # combinations that are named in sentences; the JSON holds all
VAGUE = 0.5  # of its value: the standard deviation from which a parameter is hardly known


@dataclass(frozen=True)
class Directions:
    """Names of theta; `dead` act on nothing, each of `mixed` is a combination of which only one is determined."""

    labels: tuple[str, ...]
    dead: tuple[str, ...]
    mixed: tuple[tuple[str, ...], ...]


def directions(problem: Problem, level: Level, layout: Layout) -> Directions:
    """Null directions at a fitted level, from the data alone (no prior)."""
    runs = len(problem.start.x0)
    states = [*problem.model.states, *(z for k in layout.active for z in problem.terms[k].states)]
    free = [states[i] for i in layout.free]
    labels = [f"first {name}" + (f" of run {r + 1}" if runs > 1 else "") for r in range(runs) for name in free]
    labels += [problem.label(int(j)) for j in layout.columns]
    J = level.passed.J
    if not labels or not level.passed.finite or not np.isfinite(J).all():
        return Directions(tuple(labels), (), ())
    norms, singular, Vt = _decomposed(problem, level.passed, len(layout.columns))
    dead = [labels[i] for i in np.flatnonzero(norms <= 1e-12 * max(float(norms.max()), 1e-300))]
    mixed = []
    for value, direction in zip(singular, Vt, strict=True):
        members = tuple(labels[i] for i in np.flatnonzero(np.abs(direction) > 0.2))
        if value < NULL * singular[0] and not set(members) <= set(dead):
            mixed.append(members)
    return Directions(tuple(labels), tuple(dead), tuple(mixed))


def _decomposed(problem: Problem, passed: Pass, parameters: int) -> tuple[Array, Array, Array]:
    """The columns' norms; singular values, largest first, and right singular vectors of the Jacobian scaled by them."""
    J = passed.J
    if passed.rows is None:
        norms = np.sqrt((J**2).sum(axis=0))
        return norms, *np.linalg.svd(J / np.where(norms > 0, norms, 1.0), full_matrices=False)[1:]
    A = problem.normal(passed, parameters)[0]
    norms = np.sqrt(np.diag(A))
    scale = np.where(norms > 0, norms, 1.0)
    values, vectors = np.linalg.eigh(A / np.outer(scale, scale))
    return norms, np.sqrt(np.maximum(values[::-1], 0.0)), vectors.T[::-1]


def facts(problem: Problem, level: Level, layout: Layout) -> dict[str, Any]:
    """Null directions, and the standard deviation of every parameter, for JSON."""
    found = directions(problem, level, layout)
    sds = _deviations(problem, level, layout)
    names = [problem.label(int(j)) for j in layout.columns]
    null = [*map(list, found.mixed), *([name] for name in found.dead)]
    return {"directions": null, "sd": dict(zip(names, sds.tolist(), strict=True))}


def findings(problem: Problem, level: Level, layout: Layout) -> list[str]:
    """The same in sentences, with the mend."""
    found = directions(problem, level, layout)
    said = [f"Only a combination of {', '.join(members)} acts on the data; fix all but one of them."
            for members in found.mixed[:SAID]]  # fmt: skip
    if len(found.mixed) > SAID:
        said.append(f"So it is with {len(found.mixed) - SAID} more combinations of parameters and first states.")
    said += [f"{name} has no effect on what is measured; fix it or measure more." for name in found.dead]
    mixed = {name for members in found.mixed for name in members}
    if not level.passed.finite:
        return said
    for j, sd in zip(layout.columns, _deviations(problem, level, layout), strict=True):
        name, value = problem.label(int(j)), abs(float(level.point.p[j]))
        if j < len(problem.model.parameters) and value and sd > VAGUE * value and name not in {*found.dead, *mixed}:
            said.append(f"{name} is known to {100 * sd / value:.0f} % only after these data.")
    return said


def _deviations(problem: Problem, level: Level, layout: Layout) -> Array:
    """Standard deviation of each moving parameter, prior included, (columns,)."""
    if not len(layout.columns) or not level.passed.finite:
        return np.full(len(layout.columns), np.inf)
    known = replace(problem, scale=problem.noise(level.passed))
    variances = np.diag(covariance(known, level, layout.columns))[-len(layout.columns) :]
    return np.sqrt(np.maximum(variances, 0.0))
