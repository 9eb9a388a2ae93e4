"""What the comparison says, in sentences: who wins where, by how much, how surely, at what cost, and who breaks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from suite.benchmark.comparison import ERROR, FEW, Comparison, Method
from suite.benchmark.ranking import LEVEL, friedman, not_beaten
from suite.benchmark.statistics import holm, signed_rank

KINDS = {"filter": "filters (causal)", "smoother": "smoothers (they also use later samples)"}
TESTABLE = 6  # seeds from which one condition can decide at 5 %
EVEN = 1.02  # ratios between this and its inverse are no difference that anybody would notice
FAMILIES = {"estimators": "model-error estimators", "baselines": "Kalman baselines"}


def verdict(c: Comparison) -> list[str]:
    """The sentences of the report's opening; the first is the headline."""
    if not c.conditions or not c.rows:
        return ["Nothing to compare: the store holds no result on a case with a known truth."]
    said = [*_duel(c), _setting(c)]
    said += [sentence for kind in KINDS for sentence in _race(c, kind)]
    said += [_smoothing(c), _model_error(c), _breaks(c)]
    return [sentence for sentence in said if sentence]


def champion(c: Comparison, **wanted: str) -> Method | None:
    """The method of best mean rank, tuned where it can be, that ends well on at least one case, and has TESTABLE seeds
    where there is such a one.
    """
    fine = [method for method in c.methods("tuned", **wanted) if np.isfinite(c.medians([method])).any()]
    return next((method for method in fine if c.seeds_of(method) >= TESTABLE), next(iter(fine), None))


def times(ratio: float) -> str:
    """A ratio in words."""
    return "no number in" if np.isinf(ratio) else f"{ratio:.2f} times" if ratio < 10 else f"{ratio:.0f} times"


def _band(found: tuple[float, float, float]) -> str:
    return f"{times(found[0])} {_pair(found)}"


def _pair(found: tuple[float, float, float]) -> str:
    return "[" + ", ".join("failed" if np.isinf(value) else f"{value:.2f}" for value in found[1:]) + "]"


def tally(c: Comparison, a: Method, b: Method) -> tuple[int, int, int]:
    """Under how many conditions a has the smaller median, and how often it is significantly better and worse than b
    (Wilcoxon's signed-rank test over seeds, Holm over conditions, 5 %).
    """
    medians = c.medians([a, b])
    p = holm([signed_rank(c.by_seed(a, at), c.by_seed(b, at)) for at in c.conditions])
    less = medians[0] < medians[1]
    sure = np.array(p) < LEVEL
    return int(less.sum()), int((sure & less).sum()), int((sure & (medians[0] > medians[1])).sum())


def _duel(c: Comparison) -> list[str]:
    """The question of the benchmark, filter against filter: model-error estimators or Kalman filters? The answer, and
    how sure it is.
    """
    a, b = (champion(c, kind="filter", family=family) for family in FAMILIES)
    if a is None or b is None:
        return [f"{c.methods('tuned')[0].label} has the smallest state error by mean rank."]
    ratios = c.case_ratios(a, b)
    first, second = (a, b) if len(ratios) and np.median(ratios) < 1 else (b, a)
    found, sizes = c.case_ratios(first, second), c.over_cases(first, second)
    if sizes is None:
        return [f"{first.label} leads: {second.label} gives no number."]
    p = signed_rank(dict(enumerate(found)), dict.fromkeys(range(len(found)), 1.0))
    winner = "A model-error estimator" if first is a else "A Kalman filter"
    other = "Kalman filter" if first is a else "model-error estimator"
    if sizes[2] < EVEN and sizes[1] * EVEN > 1.0:
        lead = "Neither side wins: the best Kalman filter and the best model-error estimator are level"
    elif p < LEVEL:
        lead = f"{winner} beats the best {other}"
    elif len(found) < FEW:
        lead = f"{winner} is ahead, on too few cases to decide"
    else:
        lead = f"Neither side wins: {winner[0].lower()}{winner[1:]} is ahead by no more than chance allows"
    _, better, worse = tally(c, first, second)
    band = "95 % interval" if len(found) >= FEW else "range"
    return [
        f"{lead}: {first.label} has {times(sizes[0])} the state error of {second.label}.",
        f"How surely: over {len(found)} cases the ratio of {first.label} to {second.label} (the best of the "
        f"{FAMILIES[second.family]} by mean rank) is {sizes[0]:.2f} in the median, {band} {_pair(sizes)}, Wilcoxon "
        f"p = {p:.2g}; over seeds it is significantly better under {better} of {len(c.conditions)} conditions and "
        f"significantly worse under {worse}.",
    ]


def _setting(c: Comparison) -> str:
    low, high = c.seeds
    noises = sorted({noise for _, noise in c.conditions})
    levels = ", ".join(f"{100 * noise:g} %" for noise in noises)
    seeds = f"{low}" if low == high else f"{low} to {high}"
    said = (
        f"Judged: {len(c.rows)} methods ({len({m.estimator for m in c.rows})} estimators and baselines) on "
        f"{len(c.cases)} cases at noise {levels}, {len(c.conditions)} conditions, {seeds} seeds each."
    )
    few = sum(c.seeds_of(method) < TESTABLE for method in c.rows)
    if few == len(c.rows):
        said += f" With {high} seeds no single condition can decide anything at 5 %."
    elif few:
        said += f" {few} of them, slow ones, have fewer than {TESTABLE} seeds, on which no condition can decide at 5 %."
    return said


def _race(c: Comparison, kind: str) -> list[str]:
    """The order among methods of one kind."""
    methods = c.methods("tuned", kind=kind)
    best = champion(c, kind=kind)
    if best is None or len(methods) < 2:
        return []
    ranks = c.ranks(methods)
    place = methods.index(best)
    mean = float(ranks[place].mean())
    unbeaten = sum(best in not_beaten({m: c.by_seed(m, at) for m in methods})[1] for at in c.conditions)
    said = (
        f"Among the {len(methods)} {KINDS[kind]}, {best.label} ranks best: mean rank {mean:.1f}; under {unbeaten} of "
        f"{len(c.conditions)} conditions none of them is significantly better"
    )
    if before := [f"{method.label} ({c.seeds_of(method)})" for method in methods[:place]]:
        said += f"; {', '.join(before)} would rank before it on fewer seeds"
    if c.reference is not None and best != c.reference:
        ratio = c.over_cases(best, c.reference)
        said += f"; its state error is {_band(ratio)} that of the EKF as shipped" if ratio else ""
        cost, base = c.median_of(best, "step_us"), c.median_of(c.reference, "step_us")
        if cost and base:
            said += f", at {cost / base:.2g} times its run time ({cost:.0f} against {base:.0f} microseconds a step)"
    p = friedman(ranks)
    if len(methods) > 2:
        chance = f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001"
        sure = "differ by more than chance" if p < LEVEL else "could be chance"
        said += f". The ranks of these methods {sure} (Friedman, {len(c.cases)} cases, {chance})"
    return [said + "."]


def _smoothing(c: Comparison) -> str:
    a, b = champion(c, kind="smoother"), champion(c, kind="filter")
    ratio = c.over_cases(a, b) if a and b else None
    if a is None or b is None or ratio is None:
        return ""
    return f"Where the record may be read backwards too, {a.label} has {_band(ratio)} the state error of {b.label}."


def _model_error(c: Comparison) -> str:
    """Who estimates the model error itself best, over the conditions where something is missing."""
    methods = c.methods("tuned")
    d = c.medians(methods, "d_nrmse")
    there = np.isfinite(d).any(axis=0)
    if not there.any():
        return ""
    d = d[:, there]
    middle = np.median(d, axis=1)
    if not np.isfinite(middle).any():
        return ""
    i = int(np.argmin(middle))
    wins = int((d[i] == d.min(axis=0)).sum())
    good = "" if middle[i] < 1 else ", so that under half of the conditions no estimate is better than zero"
    return (
        f"The model error d itself is estimated best by {methods[i].label}: its median error is {middle[i]:.2f} of the "
        f"size of d, the smallest under {wins} of {there.sum()} conditions{good}."
    )


def _breaks(c: Comparison) -> str:
    """Who fails, worst first; skipped cells are refusals, not failures."""
    failures = []
    for method in c.rows:
        counts = c.counts(method)
        ran = sum(counts.values()) - counts.get("skipped", 0)
        failed = ran - counts.get("ok", 0)
        if failed:
            failures.append((failed / ran, failed, ran, method.label))
    if not failures:
        return "Nothing broke: every cell that was run ended well."
    failures.sort(reverse=True)
    worst = [f"{label} {failed} of {ran}" for _, failed, ran, label in failures[:6]]
    more = f" and {len(failures) - 6} more" if len(failures) > 6 else ""
    whole = len(c.rows) - len(failures)
    return f"Who breaks: {', '.join(worst)}{more}; {whole} of {len(c.rows)} methods never failed."


def winners(c: Comparison) -> list[dict[str, Any]]:
    """Under each condition the best filter, the best smoother and the best estimate of d, tuned or not as it came."""
    filters, smoothers, every = c.methods(kind="filter"), c.methods(kind="smoother"), c.methods()
    return [
        {
            "case": at[0],
            "noise": at[1],
            "filter": _best(c, filters, j, ERROR),
            "smoother": _best(c, smoothers, j, ERROR),
            "model_error": _best(c, every, j, "d_nrmse"),
        }
        for j, at in enumerate(c.conditions)
    ]


def _best(c: Comparison, methods: Sequence[Method], j: int, metric: str) -> tuple[Method, float] | None:
    values = c.medians(methods, metric)[:, j]
    if not np.isfinite(values).any():
        return None
    return methods[int(np.argmin(values))], float(values.min())
