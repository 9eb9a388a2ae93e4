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
from scipy.special import chdtrc

from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis
from suite.discovery.frame import Point
from suite.discovery.projection import projected
from suite.discovery.terms import Term
from suite.effect import Effect, Inner

Array = npt.NDArray[np.float64]

HATS = 7  # over the range of a state
SEEN = 2e-3  # chance of a false alarm in one record, over all tests of it
MOST = 4  # states up to which every state is tried in every suspect equation


def hidden_law(problem: Problem, hypothesis: Hypothesis) -> tuple[str, str] | None:
    """(equation, state) of the law that the error still follows most clearly, or None where it follows none."""
    if not hypothesis.exact.passed.finite:
        return None
    spans = {pair: _span(problem, pair[1]) for pair in _pairs(problem)}
    hats = {pair: span for pair, span in spans.items() if span[1] > 0}
    if not hats:
        return None
    active = tuple(problem.terms[k] for k in hypothesis.active)
    wide = problem.with_terms((*active, *(hat for pair in hats for hat in [_hat(*pair)] * HATS)))
    point = _moved(problem, hypothesis, wide)
    first, smallest, found = len(active), 1.0, None
    for pair, (low, width) in hats.items():
        also = list(range(first, first + HATS))
        first += HATS
        for i, k in enumerate(also):
            point.p[wide.places(k)[1:]] = low + i * width, width
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


def _span(problem: Problem, state: str) -> tuple[float, float]:
    """Where the first hat stands and how wide each is: they cover the middle 98 % of the visited range."""
    x = problem.path[:, list(problem.model.states).index(state)]
    low, high = np.quantile(x, [0.01, 0.99])
    return float(low), float(high - low) / (HATS - 1)


def _hat(equation: str, state: str) -> Term:
    """A hat; where it stands and how wide it is are numbers beside the text, so that it is compiled once for all."""
    text = f"+a*max(0, 1 - abs({state} - centre)/width)"
    inner = {"centre": Inner("range", 0.5, 0.0, 1.0), "width": Inner("spread", 0.5, 0.0, 1.0)}
    return Term(Effect("hat", text, {}, "A hat.", "rate"), equation, text, ("a",), inner, state)


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
    return float(chdtrc(U.shape[1], LM))
