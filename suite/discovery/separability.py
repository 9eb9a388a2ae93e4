"""Separability: what these data can tell apart, what would help, and the smallest effect they would have shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from suite.discovery import words
from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis, levenberg_marquardt
from suite.discovery.frame import Point
from suite.discovery.identify import ALARM, Search
from suite.discovery.result import Verdict
from suite.discovery.scoring import score

SEPARABLE = 16.0  # delta^2 below which data cannot tell two hypotheses apart
SHOWN = 6  # rivals whose separation is computed


def distance(problem: Problem, winner: Hypothesis, rival: Hypothesis, known: Sequence[str] = ()) -> float:
    """delta^2: the squared distance, in noise units, from the winner's noise-free output to what the rival can give.

    `known` parameters stay at the winner's value: how much telling apart would gain from knowing them.
    """
    model = problem.model
    count = len(model.parameters)
    fixed = {name: replace(p, fixed=p.fixed or name in known) for name, p in model.parameters.items()}
    Y = np.where(problem.seen, winner.exact.passed.Y, np.nan)
    p = rival.exact.point.p.copy()
    for j, name in enumerate(model.parameters):
        if name in known:
            p[j] = winner.exact.point.p[j]
    start = Point(problem.start.x0, np.concatenate([winner.exact.point.p[:count], problem.start.p[count:]]))
    scale = max(float(np.mean(winner.exact.passed.e**2)), 1e-12)
    known_model = replace(model, parameters=fixed)
    clean = problem.on(replace(problem.record, y=Y), start, model=known_model, scale=scale)
    level = levenberg_marquardt(clean, Point(rival.exact.point.x0, p), 0.0, rival.active, 25, 1e-3)
    return float((level.passed.e**2).sum() / scale) if level.passed.finite else np.inf


def apart(found: Search, winner: Hypothesis, rival: Hypothesis) -> float:
    """The distance on the searched record; of a long one as the block that was searched tells, times its length."""
    if found.block is None:
        return distance(found.problem, winner, rival)
    inside = {frozenset(h.active): h for h in (found.block.base, *found.block.fitted)}
    both = [inside.get(frozenset(h.active)) for h in (winner, rival)]
    if both[0] is None or both[1] is None:
        return np.inf
    return distance(found.block.problem, both[0], both[1]) * found.problem.count / found.block.problem.count


def advice(found: Search, best: Hypothesis, rivals: Sequence[Hypothesis], verdict: Verdict) -> tuple[str, ...]:
    """What would tell the best from its nearest plausible rival: more data, or a parameter known better."""
    problem = found.problem
    said = []
    if rivals:
        gap, rival = min(((apart(found, best, h), h) for h in rivals[:SHOWN]), key=lambda pair: pair[0])
        names = [[problem.terms[k].effect.id for k in h.active] for h in (best, rival)]
        if gap < SEPARABLE:
            times = (
                f"about {SEPARABLE / gap:.2g} times the data would"
                if gap > 0.1
                else "more of the same data would not help, a parameter known better might"
            )
            said.append(words.separate(names[0], names[1], gap, times))
        gains = [
            (distance(problem, best, rival, [name]), name)
            for name, parameter in problem.model.parameters.items()
            if parameter.prior_sd > 0 and found.block is None and gap < SEPARABLE
        ]
        if gains and max(gains)[0] > max(2.0 * gap, SEPARABLE / 2):
            said.append(
                f"Knowing {max(gains)[1]} exactly would raise the separation from {gap:.2g} to {max(gains)[0]:.2g} "
                f"({SEPARABLE:g} is enough to tell)."
            )
    if best.gain > ALARM:
        said.append(words.beside(verdict, [problem.terms[k].variable for k in best.active]))
    return tuple(said)


def smallest_detectable(found: Search, named: Hypothesis) -> dict[str, float]:
    """The smallest coefficient of each candidate that these data would show in 95 of 100 records.

    Of a long record the block that was searched tells; so many times more samples show so much less.
    """
    if found.block is not None:
        inside = [h for h in (found.block.base, *found.block.fitted) if set(h.active) == set(named.active)]
        shown = smallest_detectable(found.block, inside[0]) if inside else {}
        share = float(np.sqrt(found.block.problem.count / found.problem.count))
        return {name: value * share for name, value in shown.items()}
    problem = found.problem
    if not named.exact.passed.finite:
        return {}
    library = max(len(problem.terms) - len(found.absorbed), 2)
    smallest = {}
    for entry in score(problem, named, skip=found.absorbed, exact=True):
        term = problem.terms[entry.k]
        penalty = len(term.counted) * np.log(problem.count) + 2.0 * np.log(library)
        if entry.length > 0:
            smallest[term.label] = float((np.sqrt(penalty) + 1.645) / entry.length)
    return smallest
