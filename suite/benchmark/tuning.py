"""The tuner: the same budget and the same rule for every estimator, on seeds that are never judged.

The rule (no truth is used): of the record of a tuning seed every fourth sample is taken away; the score is the mean
square of what was taken away minus the estimate's output there, over the output's variance, averaged over the tuning
seeds. A filter is so judged by its prediction over the gap, a smoother by its interpolation. It needs nothing but the
estimated states, so it is the same for all. The budget is EVALUATIONS scores: first the default, then a quasi-random
search of the stated ranges, then steps around the best that shrink. Every evaluated point is kept with its score, so
that the sensitivity to each number can be drawn.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc

from suite import along, plugins
from suite.benchmark.cells import experiment
from suite.benchmark.store import Store
from suite.case import Case
from suite.estimator import Estimator, Range
from suite.prior import default_prior
from suite.record import Record

Array = npt.NDArray[np.float64]

EVALUATIONS = 24
SEARCH = 15
SEEDS = (100_001, 100_002)
GAP = 4


def tune(case_name: str, noise: float, name: str, data: Path | None) -> dict[str, Any]:
    """The best values found: {"values": by name, "score", "default_score", "evaluations", "points": each evaluated
    value by name with its score, null where the method failed there; "case", "noise", "estimator"}. Where the method
    does not apply, {"values": none, "skipped": the reason, "evaluations": 0, ...}.
    """
    case, estimator = plugins.cases()[case_name], plugins.estimators()[name]
    records = [_with_gaps(case, experiment(case, noise, seed, data)[0], seed % GAP) for seed in SEEDS]
    told = {"case": case_name, "noise": noise, "estimator": name}
    for part, _, _ in records:
        reason = estimator.skip(case.deficient, part)
        if reason is not None:
            return {"values": {}, "skipped": reason, "evaluations": 0, "points": [], **told}
    ranges = list(estimator.tuning.values())
    names = list(estimator.tuning)
    points: list[dict[str, Any]] = []

    def score(values: Mapping[str, float]) -> float:
        reached = _score(case, estimator, records, values)
        points.append({"values": dict(values), "score": reached if math.isfinite(reached) else None})
        return reached

    default_score = score({})
    best: Array | None = None
    best_score = default_score
    cube = qmc.Sobol(len(ranges), scramble=False).random(16)[1:] if len(ranges) > 1 else _even(SEARCH)
    tried = [(score(_values(names, ranges, point)), point) for point in cube[:SEARCH]]
    start_score, start = min(tried, key=lambda pair: pair[0])
    if start_score < best_score:
        best_score, best = start_score, start
    # Steps around the best of the search, one coordinate at a time, halved after each round of both directions.
    center, center_score, reach = start, start_score, 0.5 / SEARCH if len(ranges) == 1 else 0.125
    for step in range(EVALUATIONS - 1 - SEARCH):
        axis, sign = (step // 2) % len(ranges), 1.0 if step % 2 == 0 else -1.0
        point = center.copy()
        point[axis] = np.clip(point[axis] + sign * reach, 0.0, 1.0)
        reached = score(_values(names, ranges, point))
        if reached < center_score:
            center, center_score = point, reached
        if step % (2 * len(ranges)) == 2 * len(ranges) - 1:
            reach /= 2.0
    if center_score < best_score:
        best_score, best = center_score, center
    values = {} if best is None else _values(names, ranges, best)
    return {
        "values": values,
        "score": best_score if math.isfinite(best_score) else None,
        "default_score": default_score if math.isfinite(default_score) else None,
        "evaluations": len(points),
        "points": points,
        **told,
    }


def stored(store: Store) -> list[dict[str, Any]]:
    """Every tuning of a store, the oldest first."""
    found = store.connection.execute('SELECT "values" FROM tunings ORDER BY "when"')
    return [dict(json.loads(row[0])) for row in found]


def _even(count: int) -> Array:
    return (np.arange(count)[:, None] + 0.5) / count


def _values(names: list[str], ranges: list[Range], point: Array) -> dict[str, float]:
    """A point of the unit cube in the units of the ranges."""
    values = {}
    for name, (low, high, scale), share in zip(names, ranges, point, strict=True):
        values[name] = float(low * (high / low) ** share if scale == "log" else low + share * (high - low))
    return values


def _with_gaps(case: Case, record: Record, offset: int) -> tuple[Record, Record, npt.NDArray[np.bool_]]:
    """The record with every fourth sample missing, the whole record, and which are missing; the prior is made anew."""
    gone = np.arange(len(record)) % GAP == offset
    gone[0] = False
    y = np.where(gone[:, None], np.nan, record.y)
    assert record.prior is not None
    part = Record(record.t, record.u, y, names=record.names, source=record.source)
    return part.with_prior(default_prior(case.deficient, part, np.sqrt(record.prior.R))), record, gone


def _score(
    case: Case,
    estimator: Estimator,
    records: list[tuple[Record, Record, npt.NDArray[np.bool_]]],
    values: Mapping[str, float],
) -> float:
    total = 0.0
    for part, whole, gone in records:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                estimate = estimator.estimate(case.deficient, part, **values)
            except Exception:  # a value at which a method fails is a bad value
                return math.inf
        if not np.all(np.isfinite(estimate.x)) or estimate.status != "ok":
            return math.inf
        at = np.flatnonzero(gone)
        missed = along.residuals(case.deficient, whole, estimate.x)[0][at]
        total += float(np.nanmean(missed**2 / np.nanvar(whole.y, axis=0)))
    return total / len(records)
