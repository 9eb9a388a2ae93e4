"""Rival ways to name what is missing: regressions on the model error of a filter and of a smoother.

Both calibrate the deficient model first, as every user does, and then explain the error that remains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from suite import plugins
from suite.benchmark import columns
from suite.benchmark.better import walk_density
from suite.benchmark.columns import Name
from suite.benchmark.conditions import Trial
from suite.discovery.fit import fit
from suite.discovery.noise import noise_variance
from suite.model import Model
from suite.prior import default_prior
from suite.record import Record

Array = npt.NDArray[np.float64]


SIGNIFICANT = 0.01  # of all correlations together: below it the test names its best
MOST = 3  # terms that a regression may take


@dataclass(frozen=True)
class Answer:
    """What a rival says: the effects that it takes, and all it looked at, best first, each (effect, equation)."""

    named: tuple[Name, ...]
    ranked: tuple[Name, ...]
    candidates: int = 0


def calibrated(trial: Trial) -> tuple[Model, Record]:
    """The deficient model refitted to the record, and the record with what an estimator may know."""
    model = fit(trial.model, trial.record).model
    sigma = np.sqrt(noise_variance(model, trial.record))
    return model, trial.record.with_prior(default_prior(model, trial.record, sigma))


def correlation(trial: Trial) -> Answer:
    """The correlation test on the causal filter's d (Raol and others 2016): the candidate most correlated with it."""
    model, record = calibrated(trial)
    estimate = plugins.estimators()["generalized-ie"].estimate(model, record)
    if estimate.d is None or not np.isfinite(estimate.d).all():
        raise FloatingPointError("the filter left the finite numbers")
    found = columns.named(model, trial.effects, record, estimate.x)
    disguised = columns.disguised(model, record, estimate.x, found)
    found = {name: column for name, column in found.items() if name not in disguised}
    order = list(model.states)
    scores = {}
    for name, column in found.items():
        a, b = column - column.mean(), estimate.d[:, order.index(name[1])]
        b = b - b.mean()
        size = float(np.sqrt((a @ a) * (b @ b)))
        scores[name] = abs(float(a @ b)) / size if size > 0 else 0.0
    ranked = tuple(sorted(scores, key=lambda name: -scores[name]))
    N = len(trial.record)
    sure = 0.0
    if ranked:
        r = min(scores[ranked[0]], 1.0 - 1e-12)
        sure = 2.0 * float(stats.t.sf(r * np.sqrt((N - 2) / (1.0 - r * r)), N - 2)) * len(ranked)
    return Answer(ranked[:1] if ranked and sure < SIGNIFICANT else (), ranked, len(ranked))


def smoothed_regression(trial: Trial) -> Answer:
    """Forward selection by EBIC on the smoothed d of a random-walk disturbance of the likeliest density."""
    model, record = calibrated(trial)
    smoother = plugins.estimators()["random-walk-smoother"]
    estimate = smoother.estimate(model, record, q_scale=walk_density(model, record))
    if estimate.d is None or not np.isfinite(estimate.d).all():
        raise FloatingPointError("the smoother left the finite numbers")
    found = columns.named(model, trial.effects, record, estimate.x)
    disguised = columns.disguised(model, record, estimate.x, found)
    by_equation: dict[str, dict[Name, Array]] = {}
    for name, column in found.items():
        by_equation.setdefault(name[1], {})[name] = column
    library = len(found)
    taken: list[tuple[float, Name]] = []
    firsts: list[tuple[float, Name]] = []
    for equation, group in by_equation.items():
        d = estimate.d[:, list(model.states).index(equation)]
        if not d.any():
            continue
        # What no candidate explains tells how many of the samples are independent.
        count = independent(d, np.column_stack(list(group.values())))
        firsts += [(count * np.log(_rss([column], d) / float(d @ d)), name) for name, column in group.items()]
        taken += _forward(group, d, count, library)
    # A parameter in disguise corrects the calibration; it is no missing effect.
    ranked = tuple(name for _, name in sorted(firsts) if name not in disguised)
    named = tuple(name for _, name in sorted(taken) if name not in disguised)[:MOST]
    return Answer(named, (*named, *(name for name in ranked if name not in named)), library)


def _forward(group: dict[Name, Array], d: Array, count: float, library: int) -> list[tuple[float, Name]]:
    """Terms taken one after another while EBIC falls, each with the fall that it brought (negative)."""
    taken: list[tuple[float, Name]] = []
    chosen: list[Array] = []
    price = np.log(max(count, 2.0)) + 2.0 * np.log(max(library, 2))
    rss = float(d @ d)
    while len(taken) < MOST:
        left = {name: column for name, column in group.items() if name not in [n for _, n in taken]}
        tried = {name: _rss([*chosen, column], d) for name, column in left.items()}
        if not tried:
            break
        best = min(tried, key=lambda name: tried[name])
        fall = count * np.log(max(tried[best], 1e-300) / max(rss, 1e-300)) + price
        if fall >= 0:
            break
        taken.append((fall, best))
        chosen.append(left[best])
        rss = tried[best]
    return taken


def _rss(chosen: list[Array], d: Array) -> float:
    A = np.column_stack(chosen)
    A = A / np.maximum(np.sqrt((A**2).sum(axis=0)), 1e-300)
    return float(((d - A @ np.linalg.lstsq(A, d, rcond=None)[0]) ** 2).sum())


def independent(d: Array, A: Array) -> float:
    """How many independent samples d (N,) has beside the columns A: N (1 - r) / (1 + r), r the lag-one
    autocorrelation of what all columns together leave.
    """
    A = A / np.maximum(np.sqrt((A**2).sum(axis=0)), 1e-300)
    a = d - A @ np.linalg.lstsq(A, d, rcond=None)[0]
    power = float(a @ a)
    r = float(a[1:] @ a[:-1]) / power if power > 0 else 0.0
    return max(len(d) * (1.0 - r) / (1.0 + r), 2.0)
