"""Whether a law that is in no library is still hidden in what remains: a test against any function of a state.

Beside a hypothesis that leaves white noise stand seven hats over the visited range of each state that could drive a
suspect equation. Their columns, with all that was fitted projected out, would explain LM of the remaining error; under
the hypothesis LM is chi-square distributed. A stand-in of nearly the right shape passes every test of whiteness, but
not this one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy import stats

from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis
from suite.discovery.frame import Point
from suite.discovery.scoring import projected
from suite.discovery.terms import Term
from suite.effect import Effect

Array = npt.NDArray[np.float64]

HATS = 7  # over the range of a state
SEEN = 2e-3  # chance of a false alarm in one record, over all tests of it
MOST = 4  # states up to which every state is tried in every suspect equation


def hidden_law(problem: Problem, hypothesis: Hypothesis) -> tuple[str, str] | None:
    """(equation, state) of the law that the error still follows most clearly, or None where it follows none."""
    if not hypothesis.exact.passed.finite:
        return None
    hats = {pair: list(_hats(problem, *pair)) for pair in _pairs(problem)}
    hats = {pair: terms for pair, terms in hats.items() if terms}
    if not hats:
        return None
    active = tuple(problem.terms[k] for k in hypothesis.active)
    wide = problem.with_terms((*active, *(term for terms in hats.values() for term in terms)))
    point = _moved(problem, hypothesis, wide)
    first, smallest, found = len(active), 1.0, None
    for pair, terms in hats.items():
        also = list(range(first, first + len(terms)))
        first += len(terms)
        p = _chance(wide, point, tuple(range(len(active))), also)
        if p < smallest:
            smallest, found = p, pair
    return found if smallest * len(hats) < SEEN else None


def _pairs(problem: Problem) -> Iterator[tuple[str, str]]:
    """Each suspect equation with the states that could drive it: its own, its position, in small models every one."""
    model = problem.model
    for equation in model.suspects:
        near = [s for s in model.states if s == equation or model.states[s].strip() == equation]
        for state in model.states if len(model.states) <= MOST else near:
            yield equation, state


def _hats(problem: Problem, equation: str, state: str) -> Iterator[Term]:
    """Hats of equal width over the middle 98 % of the visited range."""
    model = problem.model
    x = problem.path[:, list(model.states).index(state)]
    low, high = np.quantile(x, [0.01, 0.99])
    width = (high - low) / (HATS - 1)
    if not width > 0:
        return
    for i, centre in enumerate(np.linspace(low, high, HATS)):
        text = f"+a*max(0, 1 - abs({state} - ({float(centre)!r}))/{float(width)!r})"
        effect = Effect(f"hat{i}", text, {}, "A hat.", "rate")
        yield Term(effect, equation, text, ("a",), {}, state)


def _moved(problem: Problem, hypothesis: Hypothesis, wide: Problem) -> Point:
    """The hypothesis' point among the terms of the wider problem."""
    exact, n = hypothesis.exact.point, len(problem.model.states)
    places = [j for k in hypothesis.active for j in problem.places(k)]
    states = [j for k in hypothesis.active for j in problem.states(k)]
    p, x0 = wide.start.p.copy(), wide.start.x0.copy()
    count = len(problem.model.parameters)
    p[:count] = exact.p[:count]
    p[count : count + len(places)] = exact.p[places]
    x0[:, :n] = exact.x0[:, :n]
    x0[:, n : n + len(states)] = exact.x0[:, states]
    return Point(x0, p)


def _chance(problem: Problem, point: Point, active: tuple[int, ...], also: list[int]) -> float:
    """The chance of so large an LM if nothing is hidden."""
    own = problem.columns(active)
    columns = np.concatenate([own, np.array([problem.places(k)[0] for k in also], dtype=np.int64)])
    passed = problem.run(point, 0.0, problem.layout(active, also, columns))
    if not passed.finite:
        return 1.0
    r, B, C = projected(problem, passed, own, passed.J.shape[1] - len(also))
    lengths = np.linalg.norm(B, axis=0)
    kept = lengths > 1e-3 * np.linalg.norm(C, axis=0)
    if not kept.any():
        return 1.0
    U, singular, _ = np.linalg.svd(B[:, kept] / lengths[kept], full_matrices=False)
    U = U[:, singular > 1e-3 * singular[0]]
    LM = float(((U.T @ r) ** 2).sum() / problem.noise(passed))
    return float(stats.chi2.sf(LM, U.shape[1]))
