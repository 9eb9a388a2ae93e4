"""The verdict: how sure, in numbers and in words, from everything that was refitted."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery import misfit, separability, words
from suite.discovery.engine import Point, Problem
from suite.discovery.fit import Hypothesis, Level, covariance, homotopy, prepare, summarise
from suite.discovery.identify import ALARM, Search, needs_more, search
from suite.discovery.library import candidates
from suite.discovery.result import Candidate, Coefficient, Kind, Named, Verdict
from suite.discovery.terms import grown
from suite.effect import Effect
from suite.model import Model, Parameter
from suite.record import Record
from suite.units import brought

Array = npt.NDArray[np.float64]

SURE = 0.9  # weight from which a verdict names one effect
PLAUSIBLE = 0.99  # weight that the stated set holds
REMAINS = 0.15  # of the error beyond the noise: what may remain for an effect to count as found, though not alone
ODDS = 4.6  # of the criterion: an effect that no alarm calls for must be ten times likelier than none, 2 ln 10
DECISIVE = 10.0  # of the criterion: what a further effect must gain where the residual does not become white
NEAR = 2.5  # times the best one's remaining error: what a rival may leave where nothing explains all of it


def diagnose(model: Model, record: Record, effects: Mapping[str, Effect], absolute: bool = False) -> Verdict:
    """Compare, search, judge: the verdict on one model and one record."""
    return judge(investigate(model, record, effects, absolute))[0]


def investigate(model: Model, record: Record, effects: Mapping[str, Effect], absolute: bool = False) -> Search:
    """Everything that was fitted to this record."""
    began = time.perf_counter()
    found = search(prepare(model, record, candidates(model, effects, absolute)))
    return replace(found, seconds=time.perf_counter() - began)


def judge(found: Search) -> tuple[Verdict, Hypothesis]:
    """The verdict and the hypothesis it stands on."""
    began = time.perf_counter()
    problem, base = found.problem, found.base
    names = list(problem.model.outputs)
    everything = [base, *found.fitted]
    best = min(everything, key=found.criterion)
    settled = not needs_more(found, best)
    if not settled:
        everything = _thrifty(found, everything)
    values = np.array([found.criterion(h, h.exact if settled else h.best) for h in everything])
    best = everything[int(np.argmin(values))]
    weights = np.exp(-0.5 * (values - np.nanmin(values)))
    weights = np.where(np.isfinite(weights), weights, 0.0) / np.nansum(weights)
    if not settled:
        weights = weights * _told(best)
    ranked = sorted(zip(weights.tolist(), everything, values.tolist(), strict=True), key=lambda item: -item[0])
    kind = _kind(found, best, settled, ranked)
    named = best if kind in ("missing_effect", "ambiguous") else base
    pairs = _plausible(found, ranked, named, settled) if kind != "adequate" else []
    plausible = [candidate for _, candidate in pairs]
    count = len(problem.columns(()))
    correlations = misfit.whiteness(problem.record, _residual(problem, base.exact), names)
    error = _errors(found, named)
    weight = next((w for w, h, _ in ranked if h is named), 0.0)
    if kind == "unexplained":
        weight = 0.0
    verdict = Verdict(
        kind, "", tuple(describe(problem, named)), float(weight), tuple(plausible),
        {
            "lambda": float(base.gain), "threshold": ALARM,
            "ljung_box_p": misfit.ljung_box(correlations, problem.count // len(names), count),
        },
        separability.smallest_detectable(found, named), error, _parameters(problem, named), 0.0,
    )  # fmt: skip
    said = (
        separability.advice(found, named, [h for h, _ in pairs if h is not named], verdict)
        if kind == "ambiguous"
        else ()
    )
    verdict = replace(verdict, advice=said, sentence=words.sentence(verdict, problem, settled))
    return replace(verdict, seconds=found.seconds + time.perf_counter() - began), named


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


def _told(best: Hypothesis) -> float:
    """The share of the best one's residual variance that is noise. The rest goes to what is not in the library: a
    hypothesis that leaves a structure cannot be the whole truth, however far ahead of its rivals it is.
    """
    if not best.exact.passed.finite:
        return 0.0
    return min(1.0, 1.0 / max(float(np.mean(best.exact.passed.e**2)), 1e-12))


def _kind(found: Search, best: Hypothesis, settled: bool, ranked: Sequence[tuple[float, Hypothesis, float]]) -> Kind:
    """Adequate: the base model is best and nothing remains. Unexplained: something remains that the library barely
    touches. Ambiguous: no hypothesis has the weight, or the best leaves part of the error.
    """
    base = found.base
    if best is base:
        return "adequate" if settled else "unexplained"
    if base.gain <= ALARM and found.criterion(base) - found.criterion(best) < ODDS:
        # No alarm, and an effect only just pays for itself: what chance gives to one of many candidates.
        return "adequate"
    if not settled:
        before, after = _excess(found.problem, base.exact), _excess(found.problem, best.exact)
        return "ambiguous" if after < REMAINS * before else "unexplained"
    return "missing_effect" if ranked[0][0] >= SURE else "ambiguous"


def _excess(problem: Problem, level: Level) -> float:
    """Error beyond the noise, as a multiple of the noise's standard deviation."""
    if not level.passed.finite:
        return np.inf
    return float(np.sqrt(max(float(np.mean(level.passed.e**2)) - 1.0, 0.0)))


def _residual(problem: Problem, level: Level) -> Array:
    """Measured minus simulated in noise units, (N, outputs)."""
    residual = (problem.record.y - level.passed.Y) / np.sqrt(problem.R)
    wrapped = np.arctan2(np.sin(problem.record.y - level.passed.Y), np.cos(problem.record.y - level.passed.Y))
    return np.where(problem.angles > 0, wrapped / np.sqrt(problem.R), residual)


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
            name: Coefficient(float(exact.point.p[j]), float(np.sqrt(max(V[place[j], place[j]], 0.0))), unit[name])
            for name, j in zip(term.names, problem.places(k), strict=True)
            if name in term.counted
        }
        named.append(Named(term.effect.id, term.equation, term.shown, coefficients))
    return named


def _parameters(problem: Problem, hypothesis: Hypothesis) -> dict[str, dict[str, float]]:
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
        {name: Parameter(float(point.p[j]), free=True, bounds=(float(low[j]), float(high[j])))
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


def _errors(found: Search, named: Hypothesis) -> dict[str, Any]:
    """Errors of the calibrated base model and of the named one, the noise, and free-run errors on held-out data."""
    problem = found.problem
    names = list(problem.model.outputs)
    before = misfit.rmse(problem.record, found.base.exact.passed.Y, names)
    after = misfit.rmse(problem.record, named.exact.passed.Y, names)
    noise = dict(zip(names, np.sqrt(problem.R).tolist(), strict=True))
    error: dict[str, Any] = {"before": before, "after": after, "noise": noise}
    parts = misfit.split(problem.record)
    if parts is None:
        return error
    held: dict[str, dict[str, float]] = {}
    for label, hypothesis in (("before", found.base), ("after", named)):
        held[label] = held_out(problem, hypothesis, parts)
    return {**error, "held_out": held}


def held_out(problem: Problem, hypothesis: Hypothesis, parts: misfit.Split) -> dict[str, float]:
    """Free-run error on what is held out, of the same structure fitted to the training part alone.

    The fit starts from the file's parameters and from the coefficients found; a run of its own then has its unknown
    first state fitted, with all parameters fixed.
    """
    runs = len(parts.train.starts)
    p = problem.start.p.copy()
    for k in hypothesis.active:
        p[problem.places(k)] = hypothesis.exact.point.p[problem.places(k)]
    x0 = hypothesis.exact.point.x0[:runs]
    train = problem.on(parts.train, Point(x0, problem.start.p))
    point = homotopy(train, Point(x0, p), hypothesis.active, first=0.1).exact.point
    judged = problem.on(parts.judged, problem.start, frozen=True)
    if parts.first == 0:
        start = Point(hypothesis.exact.point.x0[-1:], point.p)
        point = homotopy(judged, start, hypothesis.active, first=0.1).exact.point if problem.free_x0.any() else start
    Y = judged.run(point, 0.0, judged.layout(hypothesis.active)).Y
    return misfit.rmse(parts.judged, Y, list(problem.model.outputs), slice(parts.first, None))


def _plausible(
    found: Search, ranked: Sequence[tuple[float, Hypothesis, float]], best: Hypothesis, settled: bool
) -> list[tuple[Hypothesis, Candidate]]:
    """The hypotheses that hold 99 % of the weight, and any other that the data cannot tell from the best.

    Where the best leaves more than noise, weights cannot rule out what explains nearly as much: that is plausible too.
    """
    problem = found.problem
    names = list(problem.model.outputs)
    chosen: list[tuple[Hypothesis, Candidate]] = []
    held, total = 0.0, sum(weight for weight, _, _ in ranked)
    for place, (weight, hypothesis, value) in enumerate(ranked):
        if not hypothesis.active or not hypothesis.exact.passed.finite:
            held += weight
            continue
        separation = None
        if hypothesis is not best and place <= separability.SHOWN and best.active:
            separation = separability.distance(problem, best, hypothesis)
        near = separation is not None and separation < separability.SEPARABLE
        if not settled and len(hypothesis.active) <= len(best.active):
            near = near or _excess(problem, hypothesis.exact) <= NEAR * _excess(problem, best.exact)
        if held < PLAUSIBLE * total or near:
            candidate = Candidate(
                tuple(describe(problem, hypothesis)),
                weight,
                value,
                misfit.rmse(problem.record, hypothesis.exact.passed.Y, names),
                separation,
                curve(problem, found.base, hypothesis, problem.terms[hypothesis.active[0]].equation),
            )
            chosen.append((hypothesis, candidate))
        held += weight
    return chosen
