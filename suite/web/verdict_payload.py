"""A verdict as the page draws it: every candidate with its weight, its curve, and the model that has it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery.fit import Hypothesis
from suite.discovery.identify import Search
from suite.discovery.outcome import amended
from suite.discovery.result import Candidate, Discrepancy, Named, Step, Verdict
from suite.discovery.separability import SEPARABLE
from suite.discovery.variable import samples
from suite.discovery.where import where
from suite.effect import Effect
from suite.model import Model
from suite.model_text import to_toml
from suite.record import Record
from suite.report.canvas import thinned
from suite.report.figures import plain
from suite.web.payloads import digits

Array = npt.NDArray[np.float64]

CURVE = 400  # points of a candidate's curve
WORTH = 0.01  # weight from which a rival is named in the headline


def verdict(found: Search, said: Verdict, step: Step, record: Record, effects: Mapping[str, Effect]) -> dict[str, Any]:
    """The object VERDICT: that of `diagnose --json` with the candidates in full."""
    candidates = [_candidate(found, said, k, step, record, effects) for k in range(len(said.plausible))]
    return said.to_json() | {"candidates": candidates, "none": none(said)}


def headline(said: Verdict, step: Step, record: Record) -> str:
    """Three short sentences: how good the model is, where it fails, what is missing."""
    fits = [f"{max(value, 0.0):.3g} % of {name}" for name, value in step.comparison.fit.items() if value == value]
    explains = f"The model explains {' and '.join(fits)}." if fits else "The model does not follow the data at all."
    fails = ""
    if step.discrepancy is not None:
        fails = where(step.discrepancy, record, step.model).replace("The model fails", "It fails", 1)
    return " ".join(filter(None, (explains, fails, _missing(said))))


def _missing(said: Verdict) -> str:
    if said.verdict == "adequate":
        return "No effect is missing."
    if said.verdict == "unexplained" or not said.plausible:
        return "Something is missing that the library does not hold."
    first = said.plausible[0]
    removed = f"; removes {100 * removes(said, first):.0f} % of the error"
    if said.verdict == "missing_effect":
        return f"Most likely missing: {label(first.effects)} ({percent(first.weight)}){removed}."
    closest = f"An effect is missing; closest: {label(first.effects)} ({percent(first.weight)})"
    rest = none(said)
    if rest > first.weight:
        return f"{closest}, but more likely none of the library is all of it ({percent(rest)})."
    told = [c for c in said.plausible if c.weight >= WORTH]
    if len(told) < 2:
        return f"{closest}{removed}."
    rivals = ", ".join(f"{label(c.effects)} ({percent(c.weight)})" for c in told[:3])
    more = f" and {len(told) - 3} more" if len(told) > 3 else ""
    return f"An effect is missing; plausible: {rivals}{more}."


def none(said: Verdict) -> float:
    """The weight of "none of these", 0..1."""
    return min(max(1.0 - sum(candidate.weight for candidate in said.plausible), 0.0), 1.0)


def label(effects: tuple[Named, ...]) -> str:
    """The effects of a candidate as words: "coulomb friction in v"."""
    return " with ".join(f"{plain(named.effect)} in {named.equation}" for named in effects)


def percent(weight: float) -> str:
    """A weight as people read it."""
    return f"{100 * weight:.0f} %" if weight >= 0.005 else "under 1 %"


def removes(said: Verdict, candidate: Candidate) -> float:
    """The share of the refitted model's error that a candidate removes, 0..1, outputs weighted by their noise."""
    before, noise = said.error["before"], said.error["noise"]
    square = [sum((error[name] / noise[name]) ** 2 for name in before) for error in (before, candidate.error)]
    if not (np.isfinite(square).all() and square[0] > 0):
        return 0.0
    return float(np.clip(1.0 - np.sqrt(square[1] / square[0]), 0.0, 1.0))


def _candidate(
    found: Search, said: Verdict, k: int, step: Step, record: Record, effects: Mapping[str, Effect]
) -> dict[str, Any]:
    candidate = said.plausible[k]
    hypothesis = _hypothesis(found, candidate)
    texts = {"model": "", "start": ""}
    if hypothesis is not None:
        # Preview shows the whole fit; the next analysis must not take what was fitted for knowledge of its own.
        texts = {"model": _text(found, hypothesis, True), "start": _text(found, hypothesis, False)}
    known = [effects[named.effect].sentence for named in candidate.effects if named.effect in effects]
    apart = ""
    if k and candidate.separation is not None and candidate.separation < SEPARABLE:
        apart = f"cannot be told apart from the first by these data: separation {candidate.separation:.2g}"
    return {
        "label": label(candidate.effects),
        "effects": [_named(named) for named in candidate.effects],
        "weight": candidate.weight,
        "criterion": candidate.criterion,
        "error": dict(candidate.error),
        "removes": removes(said, candidate),
        "separation": candidate.separation,
        "apart": apart,
        "curve": _curve(candidate, step.discrepancy, step.model, record),
        "sentence": " ".join(known),
        **texts,
    }


def _named(named: Named) -> dict[str, Any]:
    coefficients = {
        name: {"value": c.value, "sd": c.sd, **({"unit": c.unit} if c.unit else {})}
        for name, c in named.coefficients.items()
    }
    return {
        "effect": named.effect, "equation": named.equation, "term": named.term, "coefficients": coefficients,
    }  # fmt: skip


def _hypothesis(found: Search, candidate: Candidate) -> Hypothesis | None:
    """The fit that a candidate tells of."""
    terms = found.problem.terms
    wanted = [(named.effect, named.equation, named.term) for named in candidate.effects]
    for hypothesis in found.fitted:
        if [(terms[k].effect.id, terms[k].equation, terms[k].shown) for k in hypothesis.active] == wanted:
            return hypothesis
    return None


def _text(found: Search, hypothesis: Hypothesis, fitted: bool) -> str:
    return to_toml(amended(found.problem, hypothesis, fitted))


def _curve(candidate: Candidate, found: Discrepancy | None, model: Model, record: Record) -> dict[str, Any] | None:
    """What the candidate adds to the rate against the variable of the model error, by rising variable."""
    if found is None or candidate.curve is None or candidate.effects[0].equation != found.equation:
        return None
    v = samples(model, record, found)
    known = np.isfinite(v) & np.isfinite(candidate.curve)
    x, y = v[known], candidate.curve[known]
    order = np.argsort(x, kind="stable")
    kept = order[thinned(y[order], CURVE)]
    return {"x": digits(x[kept]), "y": digits(y[kept])}
