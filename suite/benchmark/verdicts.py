"""The judge of a verdict: was it right, was it as sure as it should be, were its numbers as good as they could be.

A hypothesis is right where its set of (effect, equation) is the truth's ("strict"), or where it is the same function as
far as these data can tell ("merged"): the same number of effects, and delta^2 from the truth below SAME, or a column
that correlates with the truth's above 0.9999 while delta^2 is too small to separate them.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from suite.benchmark.conditions import Trial
from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis, homotopy
from suite.discovery.frame import Point
from suite.discovery.identify import Search
from suite.discovery.result import Named, Verdict
from suite.discovery.separability import SEPARABLE, distance
from suite.discovery.verdict import investigate, judge

Array = npt.NDArray[np.float64]
Names = frozenset[tuple[str, str]]

SAME = 1e-3  # delta^2 of two hypotheses that are one function on these data
ALIKE = 1.0 - 0.9999**2  # share of the truth's effect that a look-alike leaves
COMPARED = 8  # rivals, best first, whose delta^2 is computed
TRIED = 4  # ways to bind the truth's effects that are refitted
INTERVAL = 1.96
LAGS = 20


def row(trial: Trial) -> dict[str, Any]:
    """What the verdict says of a trial, and what it is worth."""
    start, busy = time.perf_counter(), time.process_time()
    found = investigate(trial.model, trial.record, trial.effects)
    verdict, named = judge(found)
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    said: dict[str, Any] = {
        "verdict": verdict.verdict,
        "named": written(_names(verdict.effects)),
        "weight": verdict.weight,
        "alarm": verdict.verdict != "adequate",
        "lambda": verdict.detection.get("lambda"),
        "ljung_box_before": verdict.detection.get("ljung_box_p"),
        "plausible": [written(_names(candidate.effects)) for candidate in verdict.plausible],
        "plausible_weights": [candidate.weight for candidate in verdict.plausible],
        "candidates": len(found.problem.terms),
        "depth": max((len(hypothesis.active) for hypothesis in found.fitted), default=0),
        "measurements": found.problem.count,
        "seconds": seconds,
        "cpu_seconds": busy,
    }
    return said | _residual(trial, named) | _recovered(trial, found, verdict)


def written(names: Names) -> str:
    """A set of effects in a word: effect@equation, joined by +."""
    return "+".join(f"{effect}@{equation}" for effect, equation in sorted(names))


def _names(effects: tuple[Named, ...]) -> Names:
    return frozenset((named.effect, named.equation) for named in effects)


def _of(problem: Problem, hypothesis: Hypothesis) -> Names:
    return frozenset((problem.terms[k].effect.id, problem.terms[k].equation) for k in hypothesis.active)


def _residual(trial: Trial, named: Hypothesis) -> dict[str, Any]:
    """Residual of the named hypothesis over the sensor's true noise, and its Ljung-Box p."""
    gap = trial.record.y - named.exact.passed.Y
    angles = np.array([output.angle for output in trial.model.outputs.values()])
    e = np.where(angles, np.arctan2(np.sin(gap), np.cos(gap)), gap) / trial.sigma
    if not np.isfinite(e).any():
        return {}
    p = min(_ljung_box(channel[np.isfinite(channel)]) for channel in e.T)
    return {"residual": float(np.sqrt(np.nanmean(e**2))), "ljung_box_after": min(1.0, p * e.shape[1])}


def _ljung_box(e: Array) -> float:
    """p-value of the Ljung-Box statistic of a residual (N,) with LAGS lags; small is coloured."""
    N, power = len(e), float(e @ e)
    if N <= LAGS + 1 or power == 0.0:
        return 1.0
    r = np.array([float(e[lag:] @ e[:-lag]) / power for lag in range(1, LAGS + 1)])
    return float(chi2.sf(N * (N + 2.0) * float((r**2 / (N - np.arange(1, LAGS + 1))).sum()), LAGS))


def _recovered(trial: Trial, found: Search, verdict: Verdict) -> dict[str, Any]:
    """Rank of the truth, whether it is named and in the plausible set, delta^2 and the coefficients' errors."""
    truth, named = trial.truth, _names(verdict.effects)
    ordered = sorted([found.base, *found.fitted], key=found.criterion)
    if not truth:
        return {}
    apart = _distances(trial, found, ordered)
    same = {_of(found.problem, h) for h, _ in apart["same"]} | {truth}
    sets = [_of(found.problem, h) for h in ordered]
    plausible = [_names(candidate.effects) for candidate in verdict.plausible]
    return {
        "rank": sets.index(truth) + 1 if truth in sets else None,
        "first": truth <= named,
        "exact": named == truth,
        "in_plausible": truth in plausible,
        "first_merged": truth <= named or named in same,
        "exact_merged": named in same,
        "in_plausible_merged": any(names in same for names in plausible),
        "delta2": apart["strict"],
        "delta2_merged": apart["merged"],
        "rival": apart["rival"],
        "detectable": apart["base"],
        **(_coefficients(trial, verdict) if named == truth else {}),
    }


def _distances(trial: Trial, found: Search, ordered: list[Hypothesis]) -> dict[str, Any]:
    """delta^2 from the truth to its nearest rival that does not contain it, with and without look-alikes.

    A rival has no more effects than the truth; where the truth is outside the library, any number.
    """
    problem, truth = found.problem, trial.truth
    held = _truth(trial, found) if trial.known else None
    winner = held if held is not None and held.exact.passed.finite else _from_output(trial, found)
    most = len(truth) if trial.known else len(problem.terms)
    rivals = [
        h for h in ordered
        if not truth <= _of(problem, h) and len(h.active) <= most and h.exact.passed.finite
    ][:COMPARED]  # fmt: skip
    pairs = [(h, distance(problem, winner, h)) for h in rivals]
    base = distance(problem, winner, found.base) if found.base.exact.passed.finite else np.inf
    pairs += [(found.base, base)] if found.base not in rivals else []
    same = [(h, d) for h, d in pairs if len(h.active) == len(truth) and (d < SAME or d < min(ALIKE * base, SEPARABLE))]
    other = [(h, d) for h, d in pairs if h not in [s for s, _ in same]]
    nearest = min(other, key=lambda pair: pair[1]) if other else (found.base, base)
    return {
        "same": same,
        "base": _finite(base),
        "strict": _finite(min((d for _, d in pairs), default=base)),
        "merged": _finite(nearest[1]),
        "rival": written(_of(problem, nearest[0])) or "nothing missing",
    }


def _finite(value: float) -> float:
    """A number that a row can hold: what no rival comes near is far, not infinite."""
    return float(min(value, 1e12))


def _truth(trial: Trial, found: Search) -> Hypothesis | None:
    """The truth among what was fitted, else fitted here from the true coefficients; None where it cannot be."""
    problem = found.problem
    fitted = [h for h in found.fitted if _of(problem, h) == trial.truth]
    if fitted:
        return min(fitted, key=found.criterion)
    bound = [
        [k for k, term in enumerate(problem.terms) if (term.effect.id, term.equation) == (m.effect, m.equation)]
        for m in trial.missing
    ]
    tried = []
    for active in list(product(*bound))[:TRIED]:
        p = found.base.exact.point.p.copy()
        for k, entry in zip(active, trial.missing, strict=True):
            values = list(entry.coefficients.values())[: len(problem.terms[k].names)]
            p[problem.places(k)[: len(values)]] = values
        tried.append(homotopy(problem, Point(found.base.exact.point.x0, p), active, first=0.1))
    return min(tried, key=lambda hypothesis: hypothesis.exact.L, default=None)


def _from_output(trial: Trial, found: Search) -> Hypothesis:
    """A stand-in for a truth outside the library: the base hypothesis with the true output in place of its own."""
    problem, exact = found.problem, found.base.exact
    e = ((trial.record.y - trial.clean) / np.sqrt(problem.R))[problem.seen]
    passed = replace(exact.passed, Y=trial.clean.copy(), e=e)
    return replace(found.base, levels=(*found.base.levels[:-1], replace(exact, passed=passed)))


def _coefficients(trial: Trial, verdict: Verdict) -> dict[str, Any]:
    """(value - true)/sd of each coefficient of the missing effects, by name; inner scales are not judged."""
    z: dict[str, float] = {}
    counts = Counter(entry.effect for entry in trial.missing)
    for entry in trial.missing:
        named = next(n for n in verdict.effects if (n.effect, n.equation) == (entry.effect, entry.equation))
        # Coefficients come first, inner scales after them.
        stated = list(named.coefficients.values())[: len(trial.library[entry.effect].coefficients)]
        for (name, true), c in zip(entry.coefficients.items(), stated, strict=False):
            label = f"{entry.effect}.{name}" if counts[entry.effect] == 1 else f"{entry.effect}@{entry.equation}.{name}"
            if c.sd > 0 and np.isfinite(c.sd):
                z[label] = float((c.value - true) / c.sd)
    return {"z": z, "covered": {name: abs(value) < INTERVAL for name, value in z.items()}}
