"""Where the model fails: simulated against measured, and the smoothed model error against every state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import stats

from suite.discovery.engine import Point, Problem
from suite.discovery.fit import homotopy, prepare
from suite.discovery.noise import noise_variance
from suite.discovery.result import Comparison, Discrepancy
from suite.filtering import Filtered, filtered
from suite.model import Model
from suite.record import Record, join
from suite.smoothing import smoothed

Array = npt.NDArray[np.float64]

BINS = 12
LAGS = 20
ENOUGH = 60  # samples of a single run from which the last part is held out
HELD = 0.3  # of a single run: the part that is held out


def frozen(model: Model) -> Model:
    """The model with every parameter exact, so that a fit moves initial states only."""
    return replace(model, parameters={name: replace(p, fixed=True) for name, p in model.parameters.items()})


def simulate(model: Model, record: Record, follow: float = 1.0) -> Array:
    """Free-run outputs (N, outputs) at the model's values; unknown initial states are fitted to the first part of
    each run, of length `follow`.
    """
    outputs = []
    for run in record.runs:
        lead = run if follow >= 1.0 else run.part(0, min(len(run), max(10, int(follow * len(run)))))
        problem = prepare(frozen(model), lead)
        point = homotopy(problem, problem.start).exact.point if problem.free_x0.any() else problem.start
        whole = replace(problem, record=run)
        outputs.append(whole.run(point, 0.0).Y)
    return np.concatenate(outputs)


def rmse(record: Record, Y: Array, names: list[str], rows: slice = slice(None)) -> dict[str, float]:
    """Root mean square of measured minus simulated, by output."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = (record.y[rows] - Y[rows]) ** 2
    there = ~np.isnan(record.y[rows])
    return {
        name: float(np.sqrt(np.mean(square[there[:, j], j]))) if there[:, j].any() else np.nan
        for j, name in enumerate(names)
    }


def compare(model: Model, record: Record, Y: Array | None = None, sigma: Array | None = None) -> Comparison:
    """The model beside the record: error, fit % = 100 (1 - |y - Y| / |y - mean y|), the worst intervals."""
    Y = simulate(model, record) if Y is None else Y
    sigma = np.sqrt(noise_variance(model, record)) if sigma is None else sigma
    names = list(model.outputs)
    error = rmse(record, Y, names)
    spread = {name: float(np.nanstd(record.y[:, j])) for j, name in enumerate(names)}
    fit = {name: 100.0 * (1.0 - error[name] / spread[name]) if spread[name] > 0 else np.nan for name in names}
    worst = _worst(record, (record.y - Y) / sigma)
    words = [f"{fit[name]:.3g} % of {name} (error {error[name]:.3g}, noise {sigma[j]:.2g})"
             for j, name in enumerate(names)]  # fmt: skip
    if worst:
        run, first, last = worst[0]
        which = f" of run {run + 1}" if len(record.starts) > 1 else ""
        words.append(f"the worst part is t = {first:.3g} to {last:.3g}{which}")
    return Comparison(Y, sigma, error, fit, worst, f"The model explains {'; '.join(words)}.")


def _worst(record: Record, e: Array) -> tuple[tuple[int, float, float], ...]:
    """The three worst of twenty equal parts of each run, where the mean square residual is far above the noise."""
    found = []
    bounds = record.bounds
    for r, (first, last) in enumerate(pairwise(bounds.tolist())):
        for part in np.array_split(np.arange(first, last), min(20, last - first)):
            there = e[part][np.isfinite(e[part])]
            level = float(np.mean(there**2)) if len(there) else 0.0
            # Above the 99.9 % quantile of what noise alone would give.
            if len(there) and level * len(there) > stats.chi2.ppf(0.999, len(there)):
                found.append((level, r, float(record.t[part[0]]), float(record.t[part[-1]])))
    return tuple((r, a, b) for _, r, a, b in sorted(found, reverse=True)[:3])


def whiteness(record: Record, e: Array, names: list[str]) -> dict[str, Array]:
    """Autocorrelation of the residual e (N, outputs) of each output at lags 1..20; missing samples are zero."""
    correlations = {}
    for j, name in enumerate(names):
        total, power = np.zeros(LAGS), 0.0
        for run in np.split(np.nan_to_num(e[:, j]), record.starts[1:]):
            power += float(run @ run)
            for lag in range(1, min(LAGS, len(run) - 1) + 1):
                total[lag - 1] += float(run[lag:] @ run[:-lag])
        correlations[name] = total / power if power > 0 else total
    return correlations


def ljung_box(correlations: dict[str, Array], count: int, fitted: int) -> float:
    """p-value of the Ljung-Box statistic with 20 lags, the smallest over the outputs; 1 is white."""
    smallest = 1.0
    for r in correlations.values():
        lags = np.arange(1, len(r) + 1)
        room = np.maximum(count - lags, 1)
        statistic = count * (count + 2.0) * float((r**2 / room).sum())
        smallest = min(smallest, float(stats.chi2.sf(statistic, max(len(r) - fitted, 1))))
    return min(1.0, smallest * len(correlations))


def discrepancy(problem: Problem, point: Point) -> Discrepancy:
    """The smoothed model error of a calibrated model: a random-walk disturbance in every equation that may be wrong.

    The walk's density is the most likely one of a grid, one number for all; RTS smoothing gives d and its band.
    """
    count = len(problem.model.parameters)
    values = dict(zip(problem.model.parameters, point.p[:count].tolist(), strict=True))
    model = problem.model.with_values(values)
    suspects = model.suspects
    wide = model.with_disturbance(suspects)
    n, extra = len(model.states), len(suspects)
    order = [list(model.states).index(name) for name in suspects]
    pace = problem.weights[order]
    step = float(np.median(problem.record.runs[0].dt))
    noise = float(np.mean(problem.run(point, 0.0).e ** 2)) if problem.count else 1.0
    free = problem.free_x0.astype(float)

    def passes(level: float) -> list[tuple[Record, Filtered]]:
        Q = np.concatenate([np.zeros(n), level * pace**2 / step])
        results: list[tuple[Record, Filtered]] = []
        for r, run in enumerate(problem.record.runs):
            x0 = np.concatenate([point.x0[r, :n], np.zeros(extra)])
            reach = np.maximum(np.ptp(problem.path, axis=0), 1e-300)
            P0 = np.diag(np.concatenate([free * (0.1 * reach) ** 2, pace**2]))
            results.append((run, filtered(wide, run, x0, P0, Q, problem.R * min(noise, 1.0))))
        return results

    best, chosen = -np.inf, None
    for level in 10.0 ** np.arange(-8.0, 1.5, 0.5):
        tried = passes(float(level))
        if any(f.failed_at is not None for _, f in tried):
            continue
        likelihood = sum(f.log_likelihood for _, f in tried)
        if likelihood > best:
            best, chosen = likelihood, tried
    N = len(problem.record)
    x, d, sd = np.zeros((N, n)), np.zeros((N, n)), np.zeros((N, n))
    at = 0
    for run, result in chosen or ():
        smooth = smoothed(result)
        rows = slice(at, at + len(run))
        at += len(run)
        x[rows] = smooth.x[:, :n]
        d[rows, order] = smooth.x[:, n:]
        sd[rows, order] = np.sqrt(np.maximum(np.diagonal(smooth.P, axis1=1, axis2=2)[:, n:], 0.0))
    scaled = [float(np.mean(d[:, i] ** 2)) / max(problem.weights[i] ** 2, 1e-300) for i in order]
    worst = order[int(np.argmax(scaled))]
    ratios = [correlation_ratio(x[:, i], d[:, worst]) for i in range(n)]
    ordered = int(np.argmax(ratios))
    names = list(model.states)
    return Discrepancy(x, d, sd, names[worst], names[ordered], float(ratios[ordered]))


def correlation_ratio(x: Array, d: Array) -> float:
    """The share of d's variance that lies between 12 equally filled bins of x, 0..1."""
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    if len(edges) < 3 or np.var(d) == 0:
        return 0.0
    which = np.clip(np.digitize(x, edges) - 1, 0, len(edges) - 2)
    means = np.array([d[which == b].mean() if (which == b).any() else 0.0 for b in range(len(edges) - 1)])
    return float(np.var(means[which]) / np.var(d))


def where(found: Discrepancy, record: Record, names: list[str]) -> str:
    """In words where d stands out of its band against its variable: "fails for |x2| > 2.6, in every run"."""
    i, j = names.index(found.variable), names.index(found.equation)
    x, d, sd = found.x[:, i], found.d[:, j], found.d_sd[:, j]
    out = np.abs(d) > 2.0 * sd
    share = float(out.mean())
    if share < 0.05:
        return f"The smoothed error of {found.equation}' stays within its band."
    if share > 0.9:
        return f"The model fails in {found.equation}' over the whole range of {found.variable}."
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    which = np.clip(np.digitize(x, edges) - 1, 0, len(edges) - 2)
    bad = np.array([bool(out[which == b].mean() > 0.5) if (which == b).any() else False for b in range(len(edges) - 1)])
    if not bad.any():
        return (
            f"The model fails in {found.equation}' in {100 * share:.0f} % of the samples, at no one {found.variable}."
        )
    low, high = bad[: len(bad) // 2], bad[len(bad) // 2 :]
    size = (
        f"|{found.variable}|" if x.min() < 0 < x.max() and low.any() and high.any() and not bad[len(bad) // 2] else ""
    )
    if size:
        limit = min(abs(edges[1 + int(np.flatnonzero(low)[-1])]), abs(edges[len(low) + int(np.flatnonzero(high)[0])]))
        return f"The model fails in {found.equation}' for {size} > {limit:.2g}."
    spans = np.flatnonzero(bad)
    a, b = edges[spans[0]], edges[spans[-1] + 1]
    if spans[-1] == len(bad) - 1:
        return f"The model fails in {found.equation}' for {found.variable} > {a:.3g}."
    if spans[0] == 0:
        return f"The model fails in {found.equation}' for {found.variable} < {b:.3g}."
    return f"The model fails in {found.equation}' for {found.variable} from {a:.3g} to {b:.3g}."


@dataclass(frozen=True)
class Split:
    """What is fitted (`train`) and what is judged: the samples of `judged` from number `first`; its unknown first state
    is fitted to the share `lead` of it.
    """

    train: Record
    judged: Record
    lead: float
    first: int


def split(record: Record) -> Split | None:
    """Hold out the last of several runs, else the last 30 % of a long one; None for short records.

    A held-out run's unknown first state is fitted to it, with all parameters fixed; the held-out part of a single run
    is simulated through from the first sample.
    """
    runs = record.runs
    if len(runs) > 1:
        return Split(join(runs[:-1]), runs[-1], 1.0, 0)
    if len(record) < ENOUGH:
        return None
    first = int((1 - HELD) * len(record))
    return Split(record.part(0, first), record, first / len(record), first)
