"""Which effect is missing: score all candidates in one pass, refit the best, search further where one is not enough.

The score is a Lagrange-multiplier test: known parameters and initial states are projected out of the prediction error
and of each candidate's column, LM_k = (b_k' r)^2 / (s^2 |b_k|^2). It chooses what is refitted; the refit decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Index, Pass, Point, Problem
from suite.discovery.fit import LEVELS, Hypothesis, Level, homotopy, polish
from suite.discovery.library import Term
from suite.discovery.noise import spans
from suite.errors import DataError

Array = npt.NDArray[np.float64]

REFITTED = 7  # candidates refitted after the first score
BEAM = 3  # hypotheses that a second effect is added to
NEXT = 5  # second effects refitted for each of them
CLOSE = 25.0  # rivals within this of the best are converged before weights are formed
ALARM = 9.0  # Lambda above which the model fails
COLLINEAR = 1e-3  # a candidate whose column the parameters explain to this is that parameter
STARTS = (1.0, 0.3, 3.0)  # multiples of an inner scale's start that are scored


@dataclass(frozen=True, eq=False)
class Score:
    """One candidate's score at its best level: LM, the parameters it suggests (coefficients, inner scales), the level,
    and the length of its projected column in noise sds a unit of its coefficient: LM = (c length)^2.
    """

    k: int
    LM: float
    p: Array
    q: float
    length: float


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

    def criterion(self, hypothesis: Hypothesis, level: Level | None = None) -> float:
        """EBIC = L + k ln N + 2 (number of terms) ln(library size), k counting inner scales."""
        L = (level or hypothesis.exact).L
        terms = [self.problem.terms[k] for k in hypothesis.active]
        count = sum(len(term.names) for term in terms)
        library = len(self.problem.terms) - len(self.absorbed)
        extra = 2.0 * len(terms) * np.log(max(library, 2))
        tones = sum(2.0 * np.log(self.frequencies) for term in terms if _is_tone(term))
        return float(L + count * np.log(self.problem.count) + extra + tones + _few(self.problem.count, hypothesis))


def _few(samples: int, hypothesis: Hypothesis) -> float:
    """What a short record adds to the price of parameters, 2 k (k + 1) / (n - k - 1): Hurvich and Tsai (1989)."""
    k = hypothesis.exact.passed.J.shape[1]
    return 2.0 * k * (k + 1) / (samples - k - 1) if samples > k + 1 else np.inf


def _is_tone(term: Term) -> bool:
    return any(inner.of == "frequency" for inner in term.inner.values())


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
    frequencies = _frequencies(problem)
    absorbed = _absorbed(problem, base)
    scores = score(problem, base, skip=absorbed)
    found = Search(problem, base, (), absorbed, len(frequencies), tuple(scores))
    fitted = [refit(problem, base, (s.k,), s) for s in scores[:REFITTED] if s.LM > 0]
    fitted = _converged(found, fitted)
    found = replace(found, fitted=tuple(fitted))
    if fitted and needs_more(found, min(fitted, key=found.criterion)):
        found = _grow(found)
    return found


def needs_more(found: Search, best: Hypothesis) -> bool:
    """Whether something remains after the best hypothesis: a process noise is still worth having."""
    if not np.isfinite(best.exact.L) or best.gain > ALARM:
        return True
    # Where no equation may be wrong there is no process noise to be worth having: the error itself tells.
    problem, e = found.problem, best.exact.passed.e
    excess = float((e**2).sum()) - len(e)
    return not problem.weights.any() and excess > ALARM * np.sqrt(2.0 * len(e))


def score(problem: Problem, hypothesis: Hypothesis, skip: Iterable[int] = (), exact: bool = False) -> list[Score]:
    """All candidates that are not active, best first: at the likeliest level and a decade either side, or at q = 0."""
    left_out = {*skip, *hypothesis.active}
    best: dict[int, Score] = {}
    levels = [level for level in hypothesis.levels if np.isfinite(level.L)]
    if not levels:
        return []
    at = min(range(len(levels)), key=lambda i: levels[i].L)
    for level in [levels[-1]] if exact else levels[max(at - 1, 0) : at + 2]:
        for entry in _scores_at(problem, hypothesis, level, left_out):
            if entry.k not in best or entry.LM > best[entry.k].LM:
                best[entry.k] = entry
    return sorted(best.values(), key=lambda entry: -entry.LM)


def _scores_at(problem: Problem, hypothesis: Hypothesis, level: Level, left_out: set[int]) -> Iterable[Score]:
    """The scores at one level, over the starts of the inner scales; tones over their frequencies."""
    plain = [k for k in range(len(problem.terms)) if k not in left_out]
    scaled = [k for k in plain if problem.terms[k].inner and not _is_tone(problem.terms[k])]
    tones = [k for k in plain if _is_tone(problem.terms[k])]
    for multiple in STARTS:
        chosen = [k for k in plain if k not in tones] if multiple == 1.0 else scaled
        yield from _score_pass(problem, hypothesis, level, chosen, partial(_with_inner, problem, multiple))
    for omega in _frequencies(problem) if tones else ():
        yield from _score_pass(problem, hypothesis, level, tones, partial(_at_frequency, float(omega)))


def _at_frequency(omega: float, k: int) -> Array:
    """A tone's one inner scale."""
    return np.array([omega])


def _with_inner(problem: Problem, multiple: float, k: int) -> Array:
    """Candidate k's inner scales at a multiple of their start, within their range."""
    places = problem.places(k)[len(problem.terms[k].coefficients) :]
    low, high = problem.limits
    return np.clip(problem.start.p[places] * multiple, low[places], high[places])


def _score_pass(
    problem: Problem, hypothesis: Hypothesis, level: Level, chosen: list[int], inner: Callable[[int], Array]
) -> Iterable[Score]:
    if not chosen:
        return
    p = level.point.p.copy()
    coefficient_places = {}
    for k in chosen:
        places = problem.places(k)
        count = len(problem.terms[k].coefficients)
        coefficient_places[k] = places[:count]
        p[places[:count]] = 0.0
        p[places[count:]] = inner(k)
    own = problem.columns(hypothesis.active)
    columns = np.concatenate([own, *(np.array(places, dtype=np.int64) for places in coefficient_places.values())])
    passed = problem.run(Point(level.point.x0, p), level.q, [*hypothesis.active, *chosen], columns)
    if not passed.finite:
        return
    width = passed.J.shape[1] - (len(columns) - len(own))
    r, B, C = _projected(problem, passed, own, width)
    noise = problem.noise(passed)
    at = 0
    for k in chosen:
        count = len(coefficient_places[k])
        b = B[:, at : at + count]
        at += count
        gram = b.T @ b
        norms, whole = np.diag(gram), (C[:, at - count : at] ** 2).sum(axis=0)
        if not np.isfinite(gram).all() or (norms <= 1e-16 * whole).any():
            continue
        scale = np.sqrt(norms)
        c = -np.linalg.lstsq(gram / np.outer(scale, scale), b.T @ r / scale, rcond=1e-10)[0] / scale
        if problem.terms[k].effect.sign:
            c = np.maximum(c, 0.0)
        start = p.copy()
        start[coefficient_places[k]] = c
        LM = float(c @ gram @ c) / noise
        yield Score(k, LM, start[problem.places(k)], level.q, float(scale[0] / np.sqrt(noise)))


def _projected(
    problem: Problem, passed: Pass, own: Index, width: int, prior: bool = True
) -> tuple[Array, Array, Array]:
    """The error and the candidates' columns with initial states and parameters projected out (prior rows included).

    Returns r (M + priors,), B (M + priors, candidates), and the candidates' columns before, (M, candidates).
    """
    A, C = passed.J[:, :width], passed.J[:, width:]
    noise = problem.noise(passed)
    sd = problem.prior[1][own]
    rows = np.zeros((len(own), width))
    informed = np.isfinite(sd) if prior else np.zeros(len(sd), dtype=bool)
    rows[np.arange(len(own)), width - len(own) + np.arange(len(own))] = np.where(
        informed, np.sqrt(noise) / np.where(informed, sd, 1.0), 0.0
    )
    A = np.vstack([A, rows])
    norms = np.sqrt((A**2).sum(axis=0))
    A = A[:, norms > 0] / norms[norms > 0]
    U, singular, _ = np.linalg.svd(A, full_matrices=False)
    U = U[:, singular > 1e-10 * singular[0]] if len(singular) else U
    whole = np.vstack([np.column_stack([passed.e, C]), np.zeros((len(own), 1 + C.shape[1]))])
    whole = whole - U @ (U.T @ whole)
    return whole[:, 0], whole[:, 1:], C


def _absorbed(problem: Problem, base: Hypothesis) -> tuple[int, ...]:
    """Candidates that are a parameter in disguise: the data columns of the parameters explain theirs."""
    level = base.best if np.isfinite(base.best.L) else base.levels[0]
    chosen = [k for k, term in enumerate(problem.terms) if len(term.coefficients) == 1]
    if not chosen:
        return ()
    p = level.point.p.copy()
    places = np.array([problem.places(k)[0] for k in chosen], dtype=np.int64)
    own = problem.columns(())
    passed = problem.run(Point(level.point.x0, p), level.q, chosen, np.concatenate([own, places]))
    if not passed.finite:
        return ()
    width = passed.J.shape[1] - len(places)
    _, B, C = _projected(problem, passed, own, width, prior=False)
    before, after = np.sqrt((C**2).sum(axis=0)), np.sqrt((B**2).sum(axis=0))
    return tuple(k for k, b, a in zip(chosen, before, after, strict=True) if b == 0 or a < COLLINEAR * b)


def _frequencies(problem: Problem) -> Array:
    """The independent frequencies of the record, up to half of Nyquist's and to 200 of them, (frequencies,)."""
    step = float(np.median(problem.record.runs[0].dt))
    lowest = 2.0 * np.pi / problem.length
    count = int(min(0.5 * np.pi / step / lowest, 200))
    return np.asarray(lowest * np.arange(1.0, max(count, 1) + 1.0))


def refit(problem: Problem, parent: Hypothesis, active: tuple[int, ...], start: Score) -> Hypothesis:
    """Fit with one more candidate: from the score's suggestion and from zero, q lowered to 0; the better one."""
    k = start.k
    places = problem.places(k)
    count = len(problem.terms[k].coefficients)
    tried = []
    for from_zero in (False, True):
        level = next((lv for lv in parent.levels if lv.q <= start.q and np.isfinite(lv.L)), parent.best)
        p = level.point.p.copy()
        p[places] = start.p
        if from_zero:
            p[places[:count]] = 0.0
        first = start.q if start.q > 0 else LEVELS[-2]
        tried.append(homotopy(problem, Point(level.point.x0, p), active, first=first, tolerance=0.1))
        if tried[-1].gain <= ALARM and np.isfinite(tried[-1].exact.L):
            break
    return min(tried, key=lambda hypothesis: hypothesis.exact.L)


def _converged(found: Search, fitted: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Rivals that are close, converged at q = 0: unconverged ones look further away than they are."""
    if not fitted:
        return []
    best = min(found.criterion(hypothesis) for hypothesis in fitted)
    return [
        polish(found.problem, hypothesis) if found.criterion(hypothesis) < best + CLOSE else hypothesis
        for hypothesis in fitted
    ]


def _grow(found: Search) -> Search:
    """Second and third effects by beam search with swap and drop moves, while the criterion falls."""
    known = {frozenset(hypothesis.active): hypothesis for hypothesis in found.fitted}
    problem = found.problem
    for size in (2, 3):
        beam = sorted((h for h in known.values() if len(h.active) == size - 1), key=found.criterion)[:BEAM]
        best = min([found.base, *known.values()], key=found.criterion)
        for parent in beam:
            for entry in score(problem, parent, skip=found.absorbed)[:NEXT]:
                active = (*parent.active, entry.k)
                if frozenset(active) not in known:
                    known[frozenset(active)] = refit(problem, parent, active, entry)
        grown = min([found.base, *known.values()], key=found.criterion)
        # Swap and drop: the best set with each of its members replaced or removed.
        for k in grown.active if len(grown.active) == size else ():
            rest = tuple(other for other in grown.active if other != k)
            if frozenset(rest) not in known:
                known[frozenset(rest)] = homotopy(problem, grown.exact.point, rest, first=0.01, tolerance=0.1)
            for entry in score(problem, known[frozenset(rest)], skip=found.absorbed)[:2]:
                active = (*rest, entry.k)
                if frozenset(active) not in known:
                    known[frozenset(active)] = refit(problem, parent, active, entry)
        fitted = _converged(found, list(known.values()))
        known = {frozenset(hypothesis.active): hypothesis for hypothesis in fitted}
        grown = min(known.values(), key=found.criterion)
        if found.criterion(grown) >= found.criterion(best) or not needs_more(found, grown):
            break
    return replace(found, fitted=tuple(known.values()))
