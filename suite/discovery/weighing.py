"""Weights: how likely each hypothesis is, which of them are one and the same on these data, and what kind of verdict
that makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis, Level
from suite.discovery.identify import ALARM, Search, left, needs_more
from suite.discovery.library import triage
from suite.discovery.outcome import foretold, white
from suite.discovery.patchwork import hollow, patched
from suite.discovery.probe import hidden_law
from suite.discovery.result import Kind

Array = npt.NDArray[np.float64]

SURE = 0.9  # weight from which a verdict names one effect
REMAINS = 0.15  # of the error beyond the noise: what may remain for an effect to count as found, though not alone
PART = 0.35  # the same where held-out data confirm it, or what remains is
AUDIBLE = 1.0  # of the noise's deviation, or less
ODDS = 4.6  # of the criterion: an effect that no alarm calls for must be ten times likelier than none, 2 ln 10
DECISIVE = 10.0  # of the criterion: what a further effect must gain where the residual does not become white
PATCH = 0.1  # of its weight: what a patchwork of one law keeps beside a law that is not in the library
WHITE = 1e-3  # Ljung-Box p below which the residual of the best shows a structure
LESS = 0.4  # the most that all hypotheses hold together where the best leaves a structure
CONVERGED = 0.01  # of the criterion: what a fit leaves open
EVEN = 2.0  # of the criterion: what makes two hypotheses about as likely
SAME = 0.05  # squared distance of two simulations, in noise units, below which no data could tell them apart


@dataclass(frozen=True, eq=False)
class Weighed:
    """One hypothesis with its share of the weight and its criterion. `twins` are shapes that stand for no physics and
    give the same output on these data; their weight is counted with it.
    """

    hypothesis: Hypothesis
    weight: float
    criterion: float
    twins: tuple[Hypothesis, ...] = ()


@dataclass(frozen=True, eq=False)
class Weighing:
    """All hypotheses, best first; `settled` says that the best leaves nothing but noise; `law` the equation and the
    state of a law that is still hidden in it.
    """

    ranked: tuple[Weighed, ...]
    settled: bool
    law: tuple[str, str] | None = None

    @property
    def best(self) -> Weighed:
        """The likeliest."""
        return self.ranked[0]

    def doubted(self) -> Weighing:
        """The same with half of every weight given to none of the library."""
        return replace(self, ranked=tuple(replace(entry, weight=0.5 * entry.weight) for entry in self.ranked))


def weigh(found: Search) -> Weighing:
    """Weights ~ exp(-EBIC/2); where something remains, compared with it as process noise. What gives the same output
    stands together, each physics by itself.
    """
    everything = [found.base, *(h for h in found.fitted if not hollow(found.problem, h))]
    best = min(everything, key=found.criterion)
    settled = not needs_more(found, best)
    law = hidden_law(found.problem, best) if settled else None
    # A patchwork may fit; what it stands for is still not in the library.
    settled = settled and law is None and not (len(best.active) > 1 and patched(found.problem, best))
    if not settled:
        everything = _thrifty(found, [h for h in everything if not patched(found.problem, h)])
    values = [found.criterion(h, h.exact if settled else h.best) for h in everything]
    order = np.argsort(values, kind="stable")
    weights = np.exp(-0.5 * (np.array(values) - np.nanmin(values)))
    weights = np.where(np.isfinite(weights), weights, 0.0) / np.nansum(weights)
    # What stands in for a law that is not in the library leaves most of its weight to that.
    weights = weights * np.where([patched(found.problem, h) for h in everything], PATCH, 1.0)
    if not settled:
        weights = weights * _told(found, everything[order[0]])
    groups: list[list[int]] = []
    for i in order:
        home = next((g for g in groups if same(found.problem, everything[g[0]], everything[i])), None)
        if home is None:
            groups.append([int(i)])
        else:
            home.append(int(i))
    ranked = [entry for g in groups for entry in _apart(found.problem, everything, values, weights, g)]
    return Weighing(tuple(ranked), settled, law)


def same(problem: Problem, one: Hypothesis, other: Hypothesis) -> bool:
    """Whether two hypotheses give the same output on these data, and neither is simply the other with a part unused."""
    a, b = one.exact.passed, other.exact.passed
    if not (a.finite and b.finite and one.active and other.active):
        return False
    gap = ((a.Y - b.Y) ** 2 / problem.R)[problem.seen].sum() / problem.noise(a)
    return bool(gap < SAME)


def _apart(
    problem: Problem, everything: Sequence[Hypothesis], values: Sequence[float], weights: Array, group: Sequence[int]
) -> list[Weighed]:
    """The entries of a group that gives one output: every physics with its own weight, the likeliest first, or the
    plant before its sensors where they are about as likely; shapes and needless parts go with the first.
    """
    fewest = min(size(problem, everything[i]) for i in group)
    simple = [i for i in group if size(problem, everything[i]) == fewest]

    def faults(i: int) -> tuple[bool, int, float]:
        terms = [problem.terms[k] for k in everything[i].active]
        return values[i] > min(values[j] for j in simple) + EVEN, sum(map(triage, terms)), values[i]

    physics = [i for i in simple if not any(problem.terms[k].effect.generic for k in everything[i].active)]
    first, *others = sorted(physics or simple, key=faults)
    others = others if physics else []
    # What differs by less than a fit converges to does not differ; what is left over goes to these alike.
    equal = [i for i in (first, *others) if i == first or abs(values[i] - values[first]) < CONVERGED]
    rest = sum(weights[i] for i in group if i not in (first, *others))
    even = float(sum(weights[i] for i in equal) + rest) / len(equal)
    shapes = tuple(everything[i] for i in simple if i not in (first, *others))
    entries = [Weighed(everything[i], even if i in equal else float(weights[i]), values[i]) for i in (first, *others)]
    return [replace(entries[0], twins=shapes), *entries[1:]]


def size(problem: Problem, hypothesis: Hypothesis) -> int:
    """How many numbers a hypothesis has of its own, first values of its states among them."""
    terms = [problem.terms[k] for k in hypothesis.active]
    return sum(len(term.counted) + sum(z[2] for z in term.states.values()) for term in terms)


def kind(found: Search, weighing: Weighing) -> Kind:
    """Adequate: the base model is best and nothing remains. Unexplained: something remains that the library barely
    touches. Ambiguous: no hypothesis has the weight, or the best leaves part of the error: a small part, or one that
    is hardly audible beside the noise, or as much smaller on data that were not fitted.
    """
    base, best = found.base, weighing.best.hypothesis
    if best is base:
        return "adequate" if weighing.settled else "unexplained"
    if base.gain <= ALARM and found.criterion(base) - found.criterion(best) < ODDS:
        # No alarm, and an effect only just pays for itself: what chance gives to one of many candidates.
        return "adequate"
    if patched(found.problem, best):
        return "unexplained" if len(best.active) > 1 else "ambiguous"
    if not weighing.settled:
        before, after = excess(found.problem, base.exact), excess(found.problem, best.exact)
        near = after < REMAINS * before or (after < AUDIBLE and after < PART * before)
        return "ambiguous" if near or (after < PART * before and foretold(found, best) < PART) else "unexplained"
    return "missing_effect" if weighing.best.weight >= SURE else "ambiguous"


def excess(problem: Problem, level: Level) -> float:
    """Error beyond the noise, as a multiple of the noise's standard deviation."""
    if not level.passed.finite:
        return np.inf
    return float(np.sqrt(max(float(np.mean(level.passed.e**2)) - 1.0, 0.0)))


def _thrifty(found: Search, everything: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Where something remains whatever is added, a further effect must earn its place: by DECISIVE over its subsets.

    What is left then counts as process noise, alike for all, before hypotheses are compared.
    """

    def value(hypothesis: Hypothesis) -> float:
        return found.criterion(hypothesis, hypothesis.best)

    return [
        h for h in everything
        if not any(set(s.active) < set(h.active) and value(s) < value(h) + DECISIVE for s in everything)
    ]  # fmt: skip


def _told(found: Search, best: Hypothesis) -> float:
    """The share of the best one's residual variance that is noise. The rest goes to what is not in the library: a
    hypothesis that leaves a structure cannot be the whole truth, however far ahead of its rivals it is. Where the
    residual itself shows one, it is less likely than not; where held-out data bear it out, not much less.
    """
    problem = found.problem
    if not best.exact.passed.finite:
        return 0.0
    share = min(1.0, 1.0 / max(left(best), 1e-12))
    if white(problem, best.exact) > WHITE and hidden_law(problem, best) is None:
        return share
    return LESS if best.active and foretold(found, best) < PART else min(share, LESS)
