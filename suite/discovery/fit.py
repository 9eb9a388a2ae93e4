"""Maximum-likelihood fit by homotopy on the observer gain.

At a large process noise the filter follows the data whatever the model says, and every parameter is easy to find; the
noise is then lowered decade by decade to zero, where the fit is exact output error. Starting at zero fails on
unstable, chaotic and badly wrong models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from suite.delays import acting
from suite.discovery.chaos import stretches
from suite.discovery.engine import Pass, Problem
from suite.discovery.frame import Index, Layout, Point
from suite.discovery.noise import noise_variance, without_outliers
from suite.discovery.starts import brought, check_record, check_stiffness, first_states, pace_of, rough_path, start_of
from suite.discovery.terms import Term
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

EXACT = 0.01  # of the noise: what finer integration may still move
FINEST = 16  # integration steps a sample that are tried; half of them are used
RISEN = 50.0  # of the criterion: what a level may lie above the best before the levels between it and 0 are left out
LEVELS = (10.0, 1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 0.0)


@dataclass(frozen=True, eq=False)
class Level:
    """The fit at one process-noise level: where it ended, its criterion and its pass."""

    q: float
    L: float
    point: Point
    passed: Pass


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of active candidates, fitted at every level of the homotopy (by falling q, the last is q = 0)."""

    active: tuple[int, ...]
    levels: tuple[Level, ...]
    layout: Layout

    @property
    def columns(self) -> Index:
        """Indices of the parameters that moved."""
        return self.layout.columns

    @property
    def exact(self) -> Level:
        """The fit at q = 0: exact simulation."""
        return self.levels[-1]

    @property
    def best(self) -> Level:
        """The most likely level."""
        return min(self.levels, key=lambda level: level.L)

    @property
    def gain(self) -> float:
        """Lambda: how much a process noise is worth, L(0) - min L."""
        return self.exact.L - self.best.L


def levenberg_marquardt(
    problem: Problem, point: Point, q: float, active: Sequence[int], rounds: int, tolerance: float
) -> Level:
    """Minimise L at one level from `point`; returns where it ended, never worse than it began.

    Columns are scaled to one; a parameter at its bound whose gradient points outwards rests.
    """
    layout = problem.layout(active)
    columns = layout.columns
    passed = problem.run(point, q, layout)
    L = problem.cost(passed, point, layout)
    damping = 1e-3
    mean, sd = problem.prior
    known = np.isfinite(sd[columns])
    low, high = problem.limits
    edge = len(layout.free) * len(point.x0)
    for _ in range(rounds):
        if not passed.finite:
            break
        noise = problem.noise(passed)
        pulls = np.where(known, 1.0 / np.where(known, sd[columns], 1.0), 0.0)
        A, g = (part / noise for part in problem.normal(passed, len(columns)))
        inner = slice(edge, None)
        A[inner, inner] += np.diag(pulls**2)
        g[inner] += pulls**2 * (point.p[columns] - mean[columns])
        moving = np.ones(len(g), dtype=bool)
        at = point.p[columns]
        moving[inner] = ~(((at <= low[columns]) & (g[inner] > 0)) | ((at >= high[columns]) & (g[inner] < 0)))
        scale = np.sqrt(np.maximum(np.diag(A), 1e-300))
        moving &= np.isfinite(scale) & (np.diag(A) > 1e-280)
        improved = False
        theta = problem.pack(point, layout)
        for _attempt in range(8):
            index = np.flatnonzero(moving)
            scaled = A[np.ix_(index, index)] / np.outer(scale[index], scale[index])
            try:
                step = np.linalg.solve(scaled + damping * np.eye(len(index)), -g[index] / scale[index])
            except np.linalg.LinAlgError:
                damping *= 10.0
                continue
            whole = step / scale[index]
            promised = -(2.0 * g[index] @ whole + whole @ A[np.ix_(index, index)] @ whole)
            if promised < 0.1 * tolerance:
                break
            trial = theta.copy()
            trial[index] += whole
            there = problem.unpack(trial, point, layout)
            tried = problem.run(there, q, layout)
            cost = problem.cost(tried, there, layout)
            if cost < L:
                improved = True
                drop = L - cost
                point, passed, L = there, tried, cost
                damping = max(damping / 10.0, 1e-9)
                break
            damping *= 10.0
        if not improved or drop < tolerance:
            break
    return Level(q, L, point, passed)


def homotopy(
    problem: Problem,
    point: Point,
    active: Sequence[int] = (),
    first: float = LEVELS[0],
    tolerance: float = 0.05,
    rounds: int = 8,
    risen: float = RISEN,
) -> Hypothesis:
    """Fit at every level from `first` down to 0, each started where the last ended; the last one converged, those on
    the way in at most so many rounds. Where a level lies `risen` above the best, the next one is 0.
    """
    levels: list[Level] = []
    lowest = np.inf
    # Of a long record the criterion itself is large, and so is what its last digits cost.
    finest = 1e-3 * max(1.0, problem.count / 1000.0)
    for q in (level for level in LEVELS if level <= first):
        last = q == 0.0
        if not last and levels and lowest + risen < levels[-1].L:
            continue
        level = levenberg_marquardt(problem, point, q, active, 30 if last else rounds, finest if last else tolerance)
        lowest = min(lowest, level.L)
        if last and not np.isfinite(level.L) and levels:
            # The simulation left the finite numbers: keep the last level that did not.
            level = replace(levels[-1], q=0.0, L=np.inf)
        levels.append(level)
        if np.isfinite(level.L):
            point = level.point
    return Hypothesis(tuple(active), tuple(levels), problem.layout(active))


def polish(problem: Problem, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with its exact level converged, as comparing close rivals demands."""
    level = levenberg_marquardt(problem, hypothesis.exact.point, 0.0, hypothesis.active, 60, 1e-5)
    return replace(hypothesis, levels=(*hypothesis.levels[:-1], level)) if level.L <= hypothesis.exact.L else hypothesis


def covariance(problem: Problem, level: Level, columns: Index) -> Array:
    """Covariance of theta at a level, s^2 (J'J + prior precision)^-1; null directions get an infinite variance."""
    noise = problem.noise(level.passed)
    sd = problem.prior[1][columns]
    pulls = np.where(np.isfinite(sd), 1.0 / np.where(np.isfinite(sd), sd, 1.0) ** 2, 0.0)
    A = problem.normal(level.passed, len(columns))[0] / noise
    if not np.isfinite(A).all():
        return np.full(A.shape, 1e300)
    edge = A.shape[0] - len(columns)
    A[edge:, edge:] += np.diag(pulls)
    scale = np.sqrt(np.maximum(np.diag(A), 1e-300))
    values, vectors = np.linalg.eigh(A / np.outer(scale, scale))
    inverse = np.where(values > 1e-12, 1.0 / np.maximum(values, 1e-300), 1e12)
    # A parameter without any effect has a scale of zero: its variance is as large as numbers are.
    with np.errstate(over="ignore"):
        V = (vectors * inverse) @ vectors.T / np.outer(scale, scale)
    return np.asarray(np.nan_to_num(V, posinf=1e300, neginf=-1e300))


def prepare(model: Model, record: Record, terms: tuple[Term, ...] = ()) -> Problem:
    """The problem of a model beside a record: noise, a start for the initial states, weights of the process noise."""
    check_record(model, record)
    record, dropped = without_outliers(model, record)
    R = noise_variance(model, record)
    x0, free = first_states(model, record)
    problem = Problem(
        model, record, (), R, Point(x0, model.values), free, np.zeros(len(model.states)), dropped=dropped,
        rough=noise_variance(model, record, stated=False),
    )  # fmt: skip
    # The path decides the weights, the weights the path: two rounds settle it.
    path = rough_path(problem)
    for _ in range(2):
        problem = replace(problem, weights=pace_of(model, record, path), path=path)
        level = levenberg_marquardt(problem, problem.start, LEVELS[0], (), 4, 1.0)
        if level.passed.finite:
            path = level.passed.X
            x0 = level.point.x0
    cut = stretches(model, acting(record, model), path)
    if len(cut.starts) > len(record.starts):
        record = replace(record, starts=cut.starts, names=cut.names)
        x0, free = path[list(cut.starts)].copy(), np.ones_like(free)
        problem = replace(problem, record=record, free_x0=free)
    problem = replace(problem, path=path, weights=pace_of(model, record, path), start=Point(x0, model.values))
    check_stiffness(problem)
    full = replace(problem, substeps=substeps(problem, problem.start), terms=terms)
    p = np.concatenate([model.values, *(start_of(full, term) for term in terms)])
    start = Point(np.hstack([x0, np.zeros((len(x0), sum(len(term.states) for term in terms)))]), p)
    for k in range(len(terms)):
        start = brought(full, start, k)
    return replace(full, start=start)


def substeps(problem: Problem, point: Point, active: tuple[int, ...] = (), moves: float = EXACT) -> int:
    """Integration steps a sample at a point: from the problem's on doubled while that moves an output by more than
    `moves` of the noise; the problem's where the movement does not shrink as a step's error does (a chaotic plant).
    """
    layout = problem.layout(active) if active else None
    before, moved, last, count = np.inf, np.inf, problem.run(point, 0.0, layout), problem.substeps
    while last.finite and moved > moves and count < FINEST:
        finer = replace(problem, substeps=2 * count).run(point, 0.0, layout)
        before, moved = moved, float(np.max(np.abs(finer.Y - last.Y) / problem.R**0.5)) if finer.finite else np.inf
        last, count = finer, 2 * count
    settled = moved <= moves or moved <= 0.25 * before
    return max(count // 2, problem.substeps) if settled and np.isfinite(moved) else problem.substeps


@dataclass(frozen=True, eq=False)
class Fit:
    """A refitted model: its parameters as (value, sd), the simulated outputs, and what it was fitted to."""

    model: Model
    parameters: Mapping[str, tuple[float, float]]
    x0: Array
    Y: Array
    sigma: Array
    L: float
    problem: Problem = field(repr=False)
    hypothesis: Hypothesis = field(repr=False)


def fit(model: Model, record: Record) -> Fit:
    """Maximum-likelihood fit of a model's free parameters and initial states to a record; raises DataError."""
    problem = prepare(model, record)
    return summarise(problem, polish(problem, homotopy(problem, problem.start)))


def summarise(problem: Problem, hypothesis: Hypothesis) -> Fit:
    """What a fitted hypothesis says of the model's own parameters."""
    exact = hypothesis.exact
    columns = hypothesis.columns
    variances = np.diag(covariance(problem, exact, columns))
    variances = variances[len(variances) - len(columns) :]
    sds = dict(zip(columns.tolist(), np.sqrt(np.maximum(variances, 0.0)), strict=True))
    names = list(problem.model.parameters)
    parameters = {name: (float(exact.point.p[j]), float(sds.get(j, 0.0))) for j, name in enumerate(names)}
    scale = float(np.sqrt(np.mean(exact.passed.e**2)))
    return Fit(
        problem.model.with_values({name: value for name, (value, _) in parameters.items()}),
        parameters, exact.point.x0, exact.passed.Y, np.sqrt(problem.R) * scale, exact.L, problem, hypothesis,
    )  # fmt: skip
