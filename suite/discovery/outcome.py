"""What a hypothesis says once it is chosen: coefficients, parameters, the amended model, errors before and after."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery import misfit
from suite.discovery.engine import Problem
from suite.discovery.fit import LEVELS, Hypothesis, Level, covariance, homotopy, summarise
from suite.discovery.frame import Point
from suite.discovery.growing import grown
from suite.discovery.hold_out import Split, split
from suite.discovery.identify import Search
from suite.discovery.result import Coefficient, Named
from suite.discovery.term_units import brought
from suite.discovery.whiteness import ljung_box, whiteness
from suite.model import Model, Parameter

Array = npt.NDArray[np.float64]


MANY, CALM = 8192, LEVELS[-2]  # samples from which the whole record's fit is a good enough start, and its level


def residual(problem: Problem, level: Level) -> Array:
    """Measured minus simulated in noise units, (N, outputs), less what the noise remembers."""
    return problem.whitened(misfit.residual(problem.model, problem.record, level.passed.Y, np.sqrt(problem.R)))


def white(problem: Problem, level: Level, fitted: int = 0) -> float:
    """Ljung-Box p of what a level leaves; `fitted` numbers cost a lag each."""
    names = list(problem.model.outputs)
    return ljung_box(whiteness(problem.record, residual(problem, level), names), problem.count // len(names), fitted)


def describe(problem: Problem, hypothesis: Hypothesis) -> list[Named]:
    """The effects of a hypothesis with their fitted coefficients and standard deviations."""
    exact = hypothesis.exact
    if not hypothesis.active or not exact.passed.finite:
        return []
    V = covariance(problem, exact, hypothesis.columns)
    edge = V.shape[0] - len(hypothesis.columns)
    place = {int(j): edge + i for i, j in enumerate(hypothesis.columns)}
    named = []
    for k in hypothesis.active:
        term = problem.terms[k]
        unit = brought(term, problem.model)
        coefficients = {
            name: Coefficient(
                float(exact.point.p[j]),
                float(np.sqrt(max(V[place[j], place[j]], 0.0))) if j in place else 0.0,
                unit[name],
            )
            for name, j in zip(term.names, problem.places(k), strict=True)
            if name in term.stated
        }
        named.append(Named(term.effect.id, term.equation, term.shown, coefficients))
    return named


def parameters(problem: Problem, hypothesis: Hypothesis) -> dict[str, dict[str, float]]:
    """Each of the model's parameters before and after the fit, with its standard deviation."""
    fitted = summarise(problem, hypothesis)
    return {
        name: {"before": p.value, "value": fitted.parameters[name][0], "sd": fitted.parameters[name][1]}
        for name, p in problem.model.parameters.items()
    }


def amended(problem: Problem, hypothesis: Hypothesis, fitted: bool = True) -> Model:
    """The model with the hypothesis' terms added at their fitted coefficients and bounds.

    Its own parameters stand at their fitted values, or (not `fitted`) at the file's, where what is known of them holds.
    """
    point = hypothesis.exact.point
    low, high = problem.limits
    model = summarise(problem, hypothesis).model if fitted else problem.model
    terms = [problem.terms[k] for k in hypothesis.active]
    numbers = [
        {name: term.parameter(name, float(point.p[j]), float(low[j]), float(high[j]))
         for name, j in zip(term.names, problem.places(k), strict=True)}
        | {name: Parameter(float(point.x0[0, j])) for name, j in zip(term.states, problem.states(k), strict=True)}
        for k, term in zip(hypothesis.active, terms, strict=True)
    ]  # fmt: skip
    return grown(model, terms, numbers)


def curve(problem: Problem, base: Hypothesis, hypothesis: Hypothesis, equation: str) -> Array | None:
    """What the hypothesis adds to a rate of the calibrated base model along its own path, (N,); None for an effect
    outside the equations of motion.
    """
    if equation not in problem.model.states:
        return None
    i = list(problem.model.states).index(equation)
    program, record = problem.program, problem.record
    n, m = len(hypothesis.layout.states), program.parameters
    f, Fx, Fp = np.zeros(n), np.zeros((n, n)), np.zeros((n, m))
    added = np.zeros(len(record))
    u = problem.inputs(hypothesis.exact.point.p)
    for k, x in enumerate(hypothesis.exact.passed.X):
        program.rate(record.t[k], x, u[k], hypothesis.exact.point.p, hypothesis.layout.on, f, Fx, Fp)
        added[k] = f[i]
        program.rate(record.t[k], x, u[k], base.exact.point.p, base.layout.on, f, Fx, Fp)
        added[k] -= f[i]
    return added


def errors(found: Search, named: Hypothesis) -> dict[str, Any]:
    """Errors of the calibrated base model and of the named one, the noise, and free-run errors on held-out data."""
    problem = found.problem
    names = list(problem.model.outputs)
    before = misfit.rmse(problem.record, found.base.exact.passed.Y, names)
    after = misfit.rmse(problem.record, named.exact.passed.Y, names)
    noise = dict(zip(names, np.sqrt(problem.R).tolist(), strict=True))
    error: dict[str, Any] = {"before": before, "after": after, "noise": noise}
    parts = split(problem.record)
    if parts is None:
        return error
    both = {"before": _held(found, found.base, parts), "after": _held(found, named, parts)}
    return {**error, "held_out": both}


def _held(found: Search, hypothesis: Hypothesis, parts: Split) -> dict[str, float]:
    """`held_out`, once for each hypothesis of a search."""
    known: dict[frozenset[int], dict[str, float]] = found.__dict__.setdefault("_held", {})
    key = frozenset(hypothesis.active)
    if key not in known:
        known[key] = held_out(found.problem, hypothesis, parts)
    return known[key]


def held_out(problem: Problem, hypothesis: Hypothesis, parts: Split) -> dict[str, float]:
    """Free-run error on what is held out, of the same structure fitted to the training part alone.

    The fit starts where the whole record's ended; a run of its own then has its unknown first state fitted, with all
    parameters fixed.
    """
    runs = len(parts.train.starts)
    p = hypothesis.exact.point.p
    x0 = hypothesis.exact.point.x0[:runs]
    train = problem.on(parts.train, Point(x0, problem.start.p))
    point = homotopy(
        train, Point(x0, p), hypothesis.active, first=CALM if len(problem.record) > MANY else 1e-3
    ).exact.point
    judged = problem.on(parts.judged, problem.start, frozen=True)
    if parts.first == 0:
        start = Point(hypothesis.exact.point.x0[-1:], point.p)
        point = homotopy(judged, start, hypothesis.active, first=0.1).exact.point if problem.free_x0.any() else start
    Y = judged.run(point, 0.0, judged.layout(hypothesis.active)).Y
    return misfit.rmse(parts.judged, Y, list(problem.model.outputs), slice(parts.first, None))


def idle(found: Search, named: Hypothesis) -> tuple[int, ...]:
    """The effects of a hypothesis without which it predicts held-out data as well: nothing but the fit speaks for them.

    Errors of all outputs are taken together in noise units; () where the record is too short to hold anything out.
    """
    problem = found.problem
    parts = split(problem.record)
    if parts is None or not named.active:
        return ()
    known = {frozenset(h.active): h for h in (found.base, *found.fitted)}
    whole = _together(problem, _held(found, named, parts))
    spared = []
    for k in named.active:
        rest = tuple(other for other in named.active if other != k)
        without = known.get(frozenset(rest))
        if without is None:
            without = homotopy(problem, named.exact.point, rest, first=0.01, tolerance=0.1)
        if _together(problem, _held(found, without, parts)) <= whole:
            spared.append(k)
    return tuple(spared)


def foretold(found: Search, named: Hypothesis) -> float:
    """The error on held-out data with a hypothesis, as a part of the base model's; 1 where nothing can be held out."""
    parts = split(found.problem.record)
    if parts is None:
        return 1.0
    before, after = (_together(found.problem, _held(found, h, parts)) for h in (found.base, named))
    return float(np.sqrt(after / before)) if 0.0 < before < np.inf else 1.0


def _together(problem: Problem, error: dict[str, float]) -> float:
    """Sum of squared errors in noise units; infinite where a simulation ran away."""
    total = float(sum((value / sigma) ** 2 for value, sigma in zip(error.values(), np.sqrt(problem.R), strict=True)))
    return total if np.isfinite(total) else np.inf
