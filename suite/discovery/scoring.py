"""Scores: how much each candidate would explain, all of them in a few passes.

The score is a Lagrange-multiplier test: known parameters and initial states are projected out of the prediction error
and of each candidate's column, LM_k = (b_k' r)^2 / (s^2 |b_k|^2). It chooses what is refitted; the refit decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis, Level
from suite.discovery.frame import Point
from suite.discovery.library import incompatible
from suite.discovery.projection import projected
from suite.discovery.starts import brought
from suite.discovery.terms import Term

Array = npt.NDArray[np.float64]

PAIRED = 64  # candidates, by their own scores, whose pairs are looked at
PERIODS = 3  # in a record, before something that repeats can be called a tone
PEAKS = 10  # frequencies at which a tone is looked for
FEW = 16  # only every so many-th frequency is looked at where no tone is searched
COLLINEAR = 1e-3  # a candidate whose column the parameters explain to this is that parameter


def is_tone(term: Term) -> bool:
    """Whether a candidate has a frequency of its own."""
    return any(inner.of == "frequency" for inner in term.inner.values())


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


def score(
    problem: Problem, hypothesis: Hypothesis, skip: Iterable[int] = (), exact: bool = False, beside: int = 1
) -> list[Score]:
    """All candidates that are not active, best first: at the likeliest level and `beside` decades either side, or
    (`exact`) at q = 0.
    """
    left_out = {*skip, *hypothesis.active}
    best: dict[int, Score] = {}
    levels = [level for level in hypothesis.levels if np.isfinite(level.L)]
    if not levels:
        return []
    at = min(range(len(levels)), key=lambda i: levels[i].L)
    for level in [levels[-1]] if exact else levels[max(at - beside, 0) : at + beside + 1]:
        # A tone is looked for where the errors at the likeliest level repeat; elsewhere its size alone is asked for.
        tones = frequencies(problem)[::FEW] if exact else _peaks(problem, level) if level is levels[at] else ()
        for entry in _scores_at(problem, hypothesis, level, left_out, tones):
            if entry.k not in best or entry.LM > best[entry.k].LM:
                best[entry.k] = entry
    return sorted(best.values(), key=lambda entry: -entry.LM)


def _scores_at(
    problem: Problem, hypothesis: Hypothesis, level: Level, left_out: set[int], tones: Iterable[float]
) -> Iterable[Score]:
    """The scores at one level, over the tries of the inner scales; of tones at the frequencies of `tones`."""
    plain = [k for k, term in enumerate(problem.terms) if k not in left_out and not is_tone(term)]
    most = max((len(i.tries) for k in plain for i in problem.terms[k].inner.values()), default=1)
    for number in range(most):
        chosen = plain if number == 0 else [k for k in plain if problem.terms[k].inner]
        yield from _score_pass(problem, hypothesis, level, chosen, partial(_with_inner, problem, number))
    repeating = [k for k, term in enumerate(problem.terms) if k not in left_out and is_tone(term)]
    for omega in tones if repeating else ():
        yield from _score_pass(problem, hypothesis, level, repeating, partial(_at_frequency, float(omega)))


def _peaks(problem: Problem, level: Level) -> Array:
    """The frequencies at which the errors of a level repeat most, (PEAKS,) at most."""
    every = frequencies(problem)
    t = np.broadcast_to(problem.record.t[:, None], problem.seen.shape)[problem.seen]
    power = np.zeros(len(every))
    for part in np.array_split(np.arange(len(t)), max(1, len(t) // 4096)):
        waves = np.exp(-1j * np.outer(every, t[part]))
        power = power + waves @ level.passed.e[part]
    size = np.abs(power)
    padded = np.concatenate([[0.0], size, [0.0]])
    tops = np.flatnonzero((size >= padded[:-2]) & (size >= padded[2:]))
    return np.asarray(every[tops[np.argsort(-size[tops])][:PEAKS]])


def _at_frequency(omega: float, k: int) -> Array:
    """A tone's one inner scale."""
    return np.array([omega])


def _with_inner(problem: Problem, number: int, k: int) -> Array:
    """Candidate k's inner scales at the numbered multiple of their start, within their range."""
    term = problem.terms[k]
    places = problem.places(k)[len(term.coefficients) :]
    low, high = problem.limits
    values = []
    for name, inner in term.inner.items():
        zero, unit = problem.unit(term, name)
        values.append(zero + inner.start * inner.tries[number % len(inner.tries)] * unit)
    return np.asarray(np.clip(np.array(values), low[places], high[places]))


@dataclass(frozen=True, eq=False)
class Columns:
    """One pass with candidates at coefficient zero: r (M + priors,) the projected error, b the projected column(s) of
    each candidate, by its number, whole their squared lengths before, and the noise's variance in units of R.
    """

    p: Array
    r: Array
    b: Mapping[int, Array]
    whole: Mapping[int, Array]
    noise: float


def _columns(
    problem: Problem, hypothesis: Hypothesis, level: Level, chosen: Sequence[int], inner: Callable[[int], Array],
    prior: bool = True,
) -> Columns | None:  # fmt: skip
    """The projected columns of the chosen candidates at a level; None where the pass leaves the finite numbers."""
    p = level.point.p.copy()
    places = {}
    point = Point(level.point.x0, p)
    for k in chosen:
        own = problem.places(k)
        places[k] = own[: len(problem.terms[k].coefficients)]
        p[places[k]] = 0.0
        p[own[len(places[k]) :]] = inner(k)
        point = brought(problem, point, k)
    own_columns = hypothesis.columns
    columns = np.concatenate([own_columns, *(np.array(place, dtype=np.int64) for place in places.values())])
    passed = problem.run(point, level.q, problem.layout(hypothesis.active, chosen, columns))
    if not passed.finite:
        return None
    width = passed.J.shape[1] - (len(columns) - len(own_columns))
    r, B, C = projected(problem, passed, own_columns, width, prior)
    b, whole, at = {}, {}, 0
    for k in chosen:
        part = slice(at, at + len(places[k]))
        b[k], whole[k] = B[:, part], (C[:, part] ** 2).sum(axis=0)
        at += len(places[k])
    return Columns(p, r, b, whole, problem.noise(passed))


def _score_pass(
    problem: Problem, hypothesis: Hypothesis, level: Level, chosen: Sequence[int], inner: Callable[[int], Array]
) -> Iterable[Score]:
    found = _columns(problem, hypothesis, level, chosen, inner) if chosen else None
    if found is None:
        # One candidate may leave the finite numbers; the others must not suffer.
        half = len(chosen) // 2
        for part in (chosen[:half], chosen[half:]) if half else ():
            yield from _score_pass(problem, hypothesis, level, part, inner)
        return
    for k in chosen:
        solved = _solved(problem, found, (k,))
        if solved is not None:
            c, LM = solved
            places = problem.places(k)
            values = found.p[places]
            values[: len(c)] = c
            length = float(np.linalg.norm(found.b[k][:, 0]) / np.sqrt(found.noise))
            yield Score(k, LM, values, level.q, length)


def _solved(problem: Problem, found: Columns, members: Sequence[int]) -> tuple[Array, float] | None:
    """Coefficients of the members together and what they would explain; None where a column vanishes."""
    b = np.hstack([found.b[k] for k in members])
    whole = np.concatenate([found.whole[k] for k in members])
    gram = b.T @ b
    norms = np.diag(gram)
    if not np.isfinite(gram).all() or (norms <= 1e-16 * whole).any():
        return None
    scale = np.sqrt(norms)
    c = -np.linalg.lstsq(gram / np.outer(scale, scale), b.T @ found.r / scale, rcond=1e-10)[0] / scale
    c = np.maximum(c, np.concatenate([[problem.terms[k].effect.lowest] * found.b[k].shape[1] for k in members]))
    return c, float(2.0 * (-(b.T @ found.r) @ c) - c @ gram @ c) / found.noise


def pairs(problem: Problem, base: Hypothesis, scores: Sequence[Score], most: int) -> list[tuple[Score, Score]]:
    """The pairs that would explain most together, whatever each does alone: `most` at the base model's likeliest level,
    where they disturb least, and as many two decades below, where they show most.
    """
    inner = {s.k: s.p[len(problem.terms[s.k].coefficients) :] for s in scores[:PAIRED]}
    levels = [level for level in base.levels if np.isfinite(level.L)]
    if not inner or not levels:
        return []
    at = min(range(len(levels)), key=lambda i: levels[i].L)
    chosen: dict[frozenset[int], tuple[Score, Score]] = {}
    for level in {at: levels[at], min(at + 2, len(levels) - 1): levels[min(at + 2, len(levels) - 1)]}.values():
        for first, second in _pairs_at(problem, base, level, inner)[:most]:
            chosen.setdefault(frozenset((first.k, second.k)), (first, second))
    return list(chosen.values())


def _pairs_at(
    problem: Problem, base: Hypothesis, level: Level, inner: Mapping[int, Array]
) -> list[tuple[Score, Score]]:
    """All pairs at a level, best first, less the price of their parameters."""
    found = _columns(problem, base, level, list(inner), lambda k: inner[k])
    if found is None:
        return []
    ranked = []
    price = np.log(problem.count)
    for first, second in combinations(inner, 2):
        one, other = problem.terms[first], problem.terms[second]
        solved = None if incompatible(one, other) else _solved(problem, found, (first, second))
        if solved is None or (np.abs(solved[0]) == 0).any():
            continue
        counted = len(one.counted) + len(other.counted)
        ranked.append((solved[1] - price * counted, first, second, solved[0]))
    ranked.sort(key=lambda entry: -entry[0])
    best = []
    for _, first, second, c in ranked[:16]:
        edge = found.b[first].shape[1]
        best.append((_half(problem, found, first, c, 0, level.q), _half(problem, found, second, c, edge, level.q)))
    return best


def _half(problem: Problem, found: Columns, k: int, c: Array, at: int, q: float) -> Score:
    """One member of a pair, as a start for its refit."""
    count = found.b[k].shape[1]
    values = found.p[problem.places(k)]
    values[:count] = c[at : at + count]
    return Score(k, 0.0, values, q, 0.0)


def absorbed(problem: Problem, base: Hypothesis) -> tuple[int, ...]:
    """Candidates that are a parameter in disguise: the data columns of the parameters explain theirs."""
    level = base.best if np.isfinite(base.best.L) else base.levels[0]
    chosen = [k for k, term in enumerate(problem.terms) if len(term.coefficients) == 1]
    start = problem.start.p
    found = _columns(
        problem, base, level, chosen,
        lambda k: start[problem.places(k)[len(problem.terms[k].coefficients) :]], prior=False,
    )  # fmt: skip
    if found is None:
        return ()
    return tuple(
        k for k in chosen
        if found.whole[k][0] == 0 or np.linalg.norm(found.b[k]) < COLLINEAR * np.sqrt(found.whole[k][0])
    )  # fmt: skip


def frequencies(problem: Problem) -> Array:
    """The independent frequencies of the record, up to half of Nyquist's and to 200 of them, (frequencies,)."""
    step = float(np.median(problem.record.runs[0].dt))
    lowest = 2.0 * np.pi / problem.length
    count = int(min(0.5 * np.pi / step / lowest, 200))
    return np.asarray(lowest * np.arange(PERIODS, max(count, PERIODS) + 1.0))
