"""The smoothed model error: what the suspected rates need for the model to follow the data, and its band."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Problem
from suite.discovery.frame import Point
from suite.discovery.result import Discrepancy
from suite.discovery.variable import ordered
from suite.filtering import Filtered, filtered
from suite.model import Initial, Model, Parameter
from suite.record import Record
from suite.smoothing import smoothed

Array = npt.NDArray[np.float64]
Grid = tuple[float, ...]

MANY = 4  # suspected equations above which no smooth process is tried: each slope is one state more
LONG = 10_000  # samples on which the numbers of the processes are chosen
LARGE = 40  # states, with those of d, from which fewer samples and processes do: a pass grows with their square
UNLIKELY = 5.0  # of the log-likelihood: what is this far behind the likeliest counts no more
STEP = 0.5  # decades between the numbers that are tried


@dataclass(frozen=True)
class Process:
    """What d may be before the data: the model with states for it, the variance of these at the start and the density
    that drives them.
    """

    model: Model
    first: Array
    density: Array


@dataclass(frozen=True)
class Smooth:
    """Smoothed states x (N, n), errors d and their deviations sd (N, suspects)."""

    x: Array
    d: Array
    sd: Array


def discrepancy(problem: Problem, point: Point) -> Discrepancy:
    """The smoothed model error of a calibrated model and its standard deviation, by equation.

    Three processes are tried, each over a grid of its numbers (the same for all equations): a random walk, and two
    stationary ones whose size the walk has found, a rough one (Ornstein-Uhlenbeck: d may jump) and a smooth one
    (Matern 3/2). The answer is their average weighted by likelihood, so that the band holds what is not known of the
    process itself.
    """
    count = len(problem.model.parameters)
    values = dict(zip(problem.model.parameters, point.p[:count].tolist(), strict=True))
    model = problem.model.with_values(values)
    names = list(model.states)
    at = [names.index(name) for name in model.suspects]
    N, n = len(problem.record), len(names)
    d, sd = np.zeros((N, n)), np.zeros((N, n))
    sd[:, at] = np.inf
    noise = float(np.mean(problem.run(point, 0.0).e ** 2)) if problem.count else 1.0
    R = problem.R * min(noise, 1.0)
    walks = _likely(problem, point, R, _walk(problem, model), [(level,) for level in np.arange(-8.0, 3.0)])
    if not walks:
        return ordered(problem, model, problem.path[:, :n], d, sd)
    walk = _average(problem, point, R, n, walks)
    size = np.sqrt(np.mean(walk.d**2 + walk.sd**2, axis=0))
    tried = list(walks)
    for smooth in (False, True)[: 1 + (len(at) <= MANY)]:
        rates = np.arange(0.0, np.log10(problem.length / problem.step), 2 * STEP)
        process = _returning(problem, model, size, smooth)
        tried += _likely(problem, point, R, process, [(rate, 0.0) for rate in rates])
    found = _average(problem, point, R, n, tried)
    d[:, at], sd[:, at] = found.d, found.sd
    return ordered(problem, model, found.x, d, sd)


def _walk(problem: Problem, model: Model) -> Callable[[Grid], Process]:
    """d' = w from anywhere within the rate's own size; its number is the density's decade."""
    pace = problem.weights[[list(model.states).index(name) for name in model.suspects]]
    wide = model.with_disturbance(model.suspects)
    return lambda where: Process(wide, pace**2, 10.0 ** where[0] * pace**2 / problem.length)


def _returning(problem: Problem, model: Model, size: Array, smooth: bool) -> Callable[[Grid], Process]:
    """d' = -b d + w, or where `smooth` d'' = -b^2 d - 2 b d' + w; its numbers are the decades of b and of d's size."""
    wide, name = _with_rate(model, smooth)

    def process(where: Grid) -> Process:
        b, variance = 10.0 ** where[0] / problem.length, (10.0 ** where[1] * size) ** 2
        first = np.concatenate([variance, b**2 * variance]) if smooth else variance
        density = np.concatenate([0.0 * size, 4.0 * b**3 * variance]) if smooth else 2.0 * b * variance
        return Process(wide.with_values({name: b}), first, density)

    return process


def _with_rate(model: Model, smooth: bool) -> tuple[Model, str]:
    """The model with a disturbance in each suspected rate that returns to zero at the rate b (where `smooth` with a
    slope of its own, these after all disturbances), and the name of b.
    """
    wide = model.with_disturbance(model.suspects)
    taken = set(wide.states) | set(wide.parameters) | set(wide.inputs)

    def fresh(name: str) -> str:
        return name if name not in taken else fresh(f"{name}_")

    b, added = fresh("d_rate"), [f"d_{name}" for name in model.suspects]
    if smooth:
        slopes = {d: fresh(f"{d}_slope") for d in added}
        driven = slopes | {slope: f"-{b}**2*{d} - 2*{b}*{slope}" for d, slope in slopes.items()}
    else:
        driven = {d: f"-{b}*{d}" for d in added}
    initial = {**wide.initial, **{name: Initial(0.0, estimate=True) for name in driven}}
    parameters = {**wide.parameters, b: Parameter(1.0, fixed=True)}
    return replace(wide, states={**wide.states, **driven}, parameters=parameters, initial=initial), b


def _likely(
    problem: Problem, point: Point, R: Array, process: Callable[[Grid], Process], starts: Sequence[Grid]
) -> list[tuple[float, Process]]:
    """The processes near the likeliest, with their log-likelihoods: from the best of `starts` uphill on the grid, and
    all its neighbours; none where every filter left the finite numbers.
    """
    share = min(1.0, LONG / len(problem.record) * min(1.0, (LARGE / len(process(starts[0]).model.states)) ** 2))
    parts = [run.part(0, max(int(share * len(run)), min(len(run), 20))) for run in problem.record.runs]
    tried: dict[Grid, float] = {}

    def likelihood(where: Grid) -> float:
        if where not in tried:
            passes = list(_passes(problem, point, R, process(where), parts))
            whole = all(passed.failed_at is None for passed in passes)
            tried[where] = sum(passed.log_likelihood for passed in passes) if whole else -np.inf
        return tried[where]

    top = max(starts, key=likelihood)
    before: Grid = ()
    while before != top and len(tried) < 3 * len(starts) + 20:
        before = top
        for axis in range(len(top)):
            moved = [(*top[:axis], top[axis] + by, *top[axis + 1 :]) for by in (-STEP, STEP)]
            best = max(moved, key=likelihood)
            # Along a flat ridge the numbers would run away.
            top = best if likelihood(best) > likelihood(top) + 0.1 else top
    limit = tried[top] - UNLIKELY
    return [(value, process(where)) for where, value in tried.items() if np.isfinite(value) and value > limit]


def _average(problem: Problem, point: Point, R: Array, n: int, tried: Sequence[tuple[float, Process]]) -> Smooth:
    """The mean over processes weighted by likelihood; the variance holds each one's own and their spread.

    Of a large model it is the likeliest process alone.
    """
    best, first = max(tried, key=lambda entry: entry[0])
    likely = [(np.exp(value - best), process) for value, process in tried if value > best - UNLIKELY]
    if len(first.model.states) > LARGE:
        likely = [(1.0, first)]
    total = sum(weight for weight, _ in likely)
    count = len(problem.model.suspects)
    x, d, square = 0.0, 0.0, 0.0
    for weight, process in likely:
        runs = [smoothed(passed) for passed in _passes(problem, point, R, process, problem.record.runs)]
        each = np.concatenate([run.x for run in runs])
        variance = np.concatenate([np.diagonal(run.P, axis1=1, axis2=2)[:, n : n + count] for run in runs])
        share = weight / total
        x = x + share * each[:, :n]
        d = d + share * each[:, n : n + count]
        square = square + share * (np.maximum(variance, 0.0) + each[:, n : n + count] ** 2)
    return Smooth(np.asarray(x), np.asarray(d), np.sqrt(np.maximum(square - np.square(d), 0.0)))


def _passes(problem: Problem, point: Point, R: Array, process: Process, runs: Sequence[Record]) -> Iterator[Filtered]:
    """The filter's pass over each run."""
    n = len(problem.model.states)
    reach = np.maximum(np.ptp(problem.path[:, :n], axis=0), 1e-300)
    P0 = np.diag(np.concatenate([problem.free_x0[:n] * (0.1 * reach) ** 2, process.first]))
    Q = np.concatenate([np.zeros(n), process.density])
    for r, run in enumerate(runs):
        x0 = np.concatenate([point.x0[r, :n], np.zeros(len(process.first))])
        yield filtered(process.model, run, x0, P0, Q, R, spread=True)
