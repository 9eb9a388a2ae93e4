"""Which effect is missing: score all candidates, refit the best, search further where one is not enough."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from suite.discovery.abreast import each
from suite.discovery.engine import Problem
from suite.discovery.fit import LEVELS, RISEN, Hypothesis, Level, homotopy, polish, substeps
from suite.discovery.frame import Point
from suite.discovery.library import incompatible
from suite.discovery.noise import spans
from suite.discovery.patchwork import doubled
from suite.discovery.scoring import Score, absorbed, frequencies, is_tone, pairs, score
from suite.discovery.starts import brought
from suite.errors import DataError

Array = npt.NDArray[np.float64]

REFITTED = 12  # candidates refitted after the first score
BEAM = 3  # hypotheses that a second effect is added to
NEXT = 5  # second effects refitted for each of them
CLOSE = 25.0  # rivals within this of the best are converged before weights are formed
ALARM = 9.0  # Lambda above which the model fails
LOUD = 25.0  # of the noise's variance: an error from which the model fails whatever a process noise is worth
SWAPPED = 6  # candidates that are refitted in the place of each member of the best set
ROUNDS = 3  # times that swapping goes on from the best set that it led to
TURNING = 0.1  # of the noise: what finer integration may move where an effect turns within a sample
WORTH = 0.7  # of the error's variance: what a further effect must leave less than, for yet another to be sought
PAIRS = 4  # pairs that are refitted because they help together, at each of two levels


@dataclass(frozen=True, eq=False)
class Search:
    """Everything that was refitted, and the candidates that are a parameter in disguise."""

    problem: Problem
    base: Hypothesis
    fitted: tuple[Hypothesis, ...]
    absorbed: tuple[int, ...] = ()
    frequencies: int = 1
    scores: tuple[Score, ...] = field(default=())
    seconds: float = 0.0
    block: Search | None = None  # of a long record: the search on the part of it that was searched

    def criterion(self, hypothesis: Hypothesis, level: Level | None = None) -> float:
        """EBIC = L + k ln N + 2 (number of terms) ln(library size), k counting inner scales."""
        L = (level or hypothesis.exact).L
        terms = [self.problem.terms[k] for k in hypothesis.active]
        # First values that a candidate leaves open are as free as its parameters, in every run.
        open_values = sum(z[2] for term in terms for z in term.states.values()) * len(self.problem.record.starts)
        count = sum(len(term.counted) for term in terms) + open_values
        library = len(self.problem.terms) - len(self.absorbed)
        extra = 2.0 * len(terms) * np.log(max(library, 2))
        tones = sum(2.0 * np.log(self.frequencies) for term in terms if is_tone(term))
        return float(L + count * np.log(self.problem.count) + extra + tones + _few(self.problem.count, hypothesis))


def _few(samples: int, hypothesis: Hypothesis) -> float:
    """What a short record adds to the price of parameters, 2 k (k + 1) / (n - k - 1): Hurvich and Tsai (1989)."""
    k = hypothesis.exact.passed.width(len(hypothesis.columns))
    return 2.0 * k * (k + 1) / (samples - k - 1) if samples > k + 1 else np.inf


def search(problem: Problem) -> Search:
    """Fit the base model, score, refit, and add second effects while something remains to be explained.

    Raises DataError where no output ever changes.
    """
    if not spans(problem.record).any():
        names = ", ".join(problem.model.outputs)
        raise DataError(
            f"{problem.record.source}: {names} never changes, so nothing can be learned; measure while the plant moves"
        )
    base = polish(problem, homotopy(problem, problem.start))
    skipped = absorbed(problem, base)
    scores = score(problem, base, skip=skipped)
    found = Search(problem, base, (), skipped, len(frequencies(problem)), tuple(scores))
    fitted = each(lambda s: refit(problem, base, (s.k,), [s]), (s for s in scores[:REFITTED] if s.LM > 0))
    fitted = _converged(found, fitted)
    found = replace(found, fitted=tuple(fitted))
    if fitted:
        # A force that turns within a sample, as dry friction does, needs finer steps than the model.
        best = min(fitted, key=found.criterion)
        finer = substeps(problem, best.exact.point, best.active, TURNING)
        if finer > problem.substeps and np.isfinite(best.exact.L):
            return search(replace(problem, substeps=finer))
    if fitted and needs_more(found, min(fitted, key=found.criterion)):
        found = _grow(found)
    return found


def needs_more(found: Search, best: Hypothesis) -> bool:
    """Whether something remains after the best hypothesis: a process noise is still worth having, or the error is far
    above any noise.
    """
    if not np.isfinite(best.exact.L) or best.gain > ALARM:
        return True
    problem, e = found.problem, best.exact.passed.e
    # Where samples are far apart no process noise can follow them; that none helps says nothing then. A noise that
    # remembers is larger than neighbouring samples show.
    if problem.colour is None and _loudest(problem, best) > LOUD:
        return True
    # Where no equation may be wrong there is no process noise to be worth having: the error itself tells.
    excess = float((e**2).sum()) - len(e)
    return not problem.weights.any() and excess > ALARM * np.sqrt(2.0 * len(e))


def _loudest(problem: Problem, best: Hypothesis) -> float:
    """The largest mean squared error of an output, over the larger of the variances that file and record give it."""
    square = np.full(problem.seen.shape, np.nan)
    square[problem.seen] = best.exact.passed.e**2
    return float(np.nanmax(np.nanmean(square, axis=0) * problem.R / np.maximum(problem.R, problem.rough)))


def refit(problem: Problem, parent: Hypothesis, active: tuple[int, ...], starts: Sequence[Score]) -> Hypothesis:
    """Fit with more candidates: from the score's suggestion and from zero, q lowered to 0; the better one."""
    q = max(start.q for start in starts)
    level = next((lv for lv in parent.levels if lv.q <= q and np.isfinite(lv.L)), parent.best)
    tried: list[Hypothesis] = []
    for from_zero in (False, True):
        p = level.point.p.copy()
        pinned = True
        for start in starts:
            effect, places = problem.terms[start.k].effect, problem.places(start.k)
            count = len(problem.terms[start.k].coefficients)
            p[places] = start.p
            if effect.pinned or from_zero:
                p[places[:count]] = 1.0 if effect.pinned else 0.0
            pinned = pinned and effect.pinned
        point = Point(level.point.x0, p)
        for start in starts:
            point = brought(problem, point, start.k)
        tried.append(homotopy(problem, point, active, q if q > 0 else LEVELS[-2], 0.1, rounds=5))
        # From zero only where the suggestion led nowhere.
        if pinned or min(parent.exact.L, parent.best.L + RISEN) - ALARM > tried[-1].exact.L:
            break
    return min(tried, key=lambda hypothesis: hypothesis.exact.L)


def left(hypothesis: Hypothesis) -> float:
    """The mean squared error of the exact simulation, in noise units; infinite where it runs away."""
    passed = hypothesis.exact.passed
    return float(np.mean(passed.e**2)) if passed.finite else np.inf


def _converged(found: Search, fitted: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Rivals that are close, converged at q = 0: unconverged ones look further away than they are."""
    if not fitted:
        return []
    best = min(found.criterion(hypothesis) for hypothesis in fitted)
    close = [hypothesis for hypothesis in fitted if found.criterion(hypothesis) < best + CLOSE]
    polished = dict(zip(map(id, close), each(lambda h: polish(found.problem, h), close), strict=True))
    return [polished.get(id(hypothesis), hypothesis) for hypothesis in fitted]


def _grow(found: Search) -> Search:
    """Second and third effects by beam search with swap and drop moves, while the criterion falls.

    Pairs that help only together are found by their joint score on the base model.
    """
    problem = found.problem
    known = {frozenset(hypothesis.active): hypothesis for hypothesis in found.fitted}

    def extend(wanted: Iterable[tuple[Hypothesis, Sequence[Score]]]) -> None:
        fresh: dict[frozenset[int], tuple[Hypothesis, tuple[int, ...], Sequence[Score]]] = {}
        for parent, entries in wanted:
            active = (*parent.active, *(entry.k for entry in entries))
            terms = [problem.terms[k] for k in active]
            apart = any(incompatible(a, b) for i, a in enumerate(terms) for b in terms[i + 1 :])
            if frozenset(active) not in known and not apart:
                fresh.setdefault(frozenset(active), (parent, active, entries))
        known.update(zip(fresh, each(lambda job: refit(problem, *job), fresh.values()), strict=True))

    def bent(k: int) -> bool:
        effect = problem.terms[k].effect
        return effect.law == "restoring" and bool(effect.inner)

    def without(grown: Hypothesis, k: int) -> tuple[Hypothesis, list[Score]]:
        rest = tuple(other for other in grown.active if other != k)
        if frozenset(rest) not in known:
            known[frozenset(rest)] = homotopy(problem, grown.exact.point, rest, first=0.01, tolerance=0.1)
        parent = known[frozenset(rest)]
        return parent, score(problem, parent, skip=(*found.absorbed, k), beside=0)

    def sound() -> Hypothesis:
        return min((h for h in (found.base, *known.values()) if not doubled(problem, h)), key=found.criterion)

    for size in (2, 3):
        beam = sorted((h for h in known.values() if len(h.active) == size - 1), key=found.criterion)[:BEAM]
        best = min([found.base, *known.values()], key=found.criterion)
        wanted: list[tuple[Hypothesis, Sequence[Score]]] = []
        if size == 2:
            wanted += [(found.base, both) for both in pairs(problem, found.base, found.scores, PAIRS)]
        for parent in beam:
            wanted += [(parent, [entry]) for entry in score(problem, parent, skip=found.absorbed)[:NEXT]]
            # A force that bends off at a width of its own imitates a polynomial of one term more.
            for k in filter(bent, parent.active) if size == 3 and parent is beam[0] else ():
                rest, scores = without(parent, k)
                wanted += [(rest, both) for both in pairs(problem, rest, scores, 2)]
        extend(wanted)
        # Swap and drop: the best set with each of its members replaced or removed, and again the one it leads to.
        for _ in range(ROUNDS):
            grown = sound()
            others = [without(grown, k) for k in grown.active if len(grown.active) == size]
            extend((rest, [entry]) for rest, scores in others for entry in scores[:SWAPPED])
            if found.criterion(sound()) > found.criterion(grown) - ALARM:
                break
        fitted = _converged(found, list(known.values()))
        known = {frozenset(hypothesis.active): hypothesis for hypothesis in fitted}
        grown = min(known.values(), key=found.criterion)
        if found.criterion(grown) >= found.criterion(best):
            break
        if not (needs_more(found, grown) or any(map(bent, grown.active))):
            break
        if needs_more(found, grown) and left(grown) > WORTH * left(best):
            break
    return replace(found, fitted=tuple(known.values()))
