"""The verdict in words an engineer would use; the numbers come from elsewhere."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from suite.discovery.engine import Problem
from suite.discovery.result import Named, Verdict


def sentence(verdict: Verdict, problem: Problem, settled: bool) -> str:
    """The verdict in up to three sentences: what is missing, what it removes, what cannot be told."""
    match verdict.verdict:
        case "adequate":
            p = verdict.detection["ljung_box_p"]
            white = (
                "the residual is white"
                if p >= 0.001
                else "simulation is as good as any filter, though the residual is not white"
            )
            return f"The model is adequate{_moved(verdict)}: {white} (p = {p:.2g}) and no effect is missing."
        case "unexplained":
            before, noise = numbers(verdict.error["before"]), numbers(verdict.error["noise"])
            near = " with ".join(named.effect for named in verdict.plausible[0].effects) if verdict.plausible else ""
            closest = f" The closest is {near}." if near else ""
            return (
                "The model fails, and nothing in the library explains it: "
                f"the error stays at {before} against a noise of {noise}.{closest}"
            )
        case "missing_effect":
            return f"Missing: {_all(verdict)}, weight {weight(verdict.weight)}; {_falls(verdict)}."
    family = _family(verdict, problem)
    common = f" In each of them {family}." if family else ""
    rest = "" if settled else " Part of the error stays unexplained."
    return f"{_several(verdict)}{common} With the first, {_all(verdict)}, {_falls(verdict)}.{rest}"


def headline(verdict: Verdict) -> str:
    """The verdict without its numbers, for the top of a page."""
    if verdict.verdict == "missing_effect":
        names = " and ".join(f"{named.effect} in {named.equation}" for named in verdict.effects)
        return f"Missing: {names} (weight {weight(verdict.weight)})."
    if verdict.verdict == "ambiguous":
        common = re.search(r"In each of them [^.]*\.", verdict.sentence)
        return _several(verdict, brief=True) + (f" {common.group()}" if common else "")
    return verdict.sentence


def _all(verdict: Verdict) -> str:
    return " and ".join(map(effect, verdict.effects))


def _several(verdict: Verdict, brief: bool = False) -> str:
    """The plausible ones with their weights; `brief`: those of a hundredth at least."""
    told = [c for c in verdict.plausible if c.weight >= 0.01 or not brief] or list(verdict.plausible[:1])
    rivals = [" with ".join(named.effect for named in c.effects) + f" ({weight(c.weight)})" for c in told]
    more = f" and {len(rivals) - 5} more" if len(rivals) > 5 else ""
    rest = 1.0 - sum(candidate.weight for candidate in verdict.plausible)
    if rest > max(candidate.weight for candidate in verdict.plausible):
        return (
            f"An effect is missing; closest: {', '.join(rivals[:5])}{more}; "
            f"but more likely none of these is all of it ({weight(rest)})."
        )
    none = f"; or none of these ({weight(rest)})" if rest > 0.02 else ""
    opening = "An effect is missing; plausible: " if len(rivals) > 1 else "An effect is missing; most likely "
    return f"{opening}{', '.join(rivals[:5])}{more}{none}."


def effect(named: Named) -> str:
    """'cubic_stiffness in x1 (-a*x2**3, a = 0.0195 +- 0.0004 1/m^2/s^2)'."""
    numbers = ", ".join(
        f"{name} = {value_sd(c.value, c.sd)}{f' {c.unit}' if c.unit else ''}" for name, c in named.coefficients.items()
    )
    return f"{named.effect} in {named.equation} ({', '.join(filter(None, (named.term, numbers)))})"


def value_sd(value: float, sd: float) -> str:
    """A number with its standard deviation, the deviation to two digits and the value to the same place."""
    if not np.isfinite(sd) or sd <= 0:
        return f"{value:.4g}"
    if sd > 100 * abs(value):
        return f"{value:.2g} +- {sd:.1g}"
    digits = int(np.clip(np.ceil(np.log10(abs(value) / sd)) + 2, 2, 8)) if value else 2
    return f"{value:.{digits}g} +- {sd:.2g}"


def law(equation: str, state: str) -> str:
    """That what remains still follows a state."""
    return f"What remains in {equation}' still follows {state}: a law that the library does not hold acts there."


def idle(effects: Sequence[str]) -> str:
    """That held-out data do not speak for an effect."""
    return (
        f"On data held out of the fit the model predicts no better with {' or '.join(effects)} than without; "
        "the fit alone is no proof."
    )


def colour(names: Sequence[str], rho: Sequence[float]) -> str:
    """That the sensors' noise has a memory."""
    parts = ", ".join(f"{value:.2f} ({name})" for name, value in zip(names, rho, strict=True))
    return f"The sensor noise has a memory from sample to sample, {parts}; the weights take that into account."


def outliers(count: int) -> str:
    """What was done about samples that stand out."""
    if count == 1:
        return "One sample stands out from its neighbours like an outlier and was left out."
    return f"{count} samples stand out from their neighbours like outliers and were left out."


def excerpt(samples: int, used: int, pieces: int, whole: bool | None = None) -> str:
    """That a very long record is not fitted whole, and what the errors are of: all of it (`whole`) or the pieces."""
    errors = "a simulation of all of them" if whole else "these pieces, each from a first state of its own"
    said = "" if whole is None else f"; the errors stated are of {errors}"
    return (
        f"The record has {samples} samples: what is fitted is fitted to {used} of them, in {pieces} pieces that are "
        f"evenly spread or where the model fails most{said}."
    )


def many(states: int, tried: int, refitted: int) -> str:
    """What was tried of a large model."""
    return (
        f"{tried} candidates were scored and {refitted} hypotheses refitted; of a model with {states} states, "
        "couplings are tried only between states that an equation connects already."
    )


def separate(best: Sequence[str], rival: Sequence[str], apart: float, times: str) -> str:
    """What it would take to tell two hypotheses apart."""
    return (
        f"These data hardly tell {' with '.join(best)} from {' with '.join(rival)} "
        f"(delta^2 = {apart:.2g}, 16 is enough); {times}, or a larger amplitude."
    )


def beside(verdict: Verdict, variables: Sequence[str]) -> str:
    """What a remainder means for the plausible set, and what would reduce it."""
    rest = "Part of the error stays: a second effect, or one that is not in the library, acts beside it."
    others = [" with ".join(named.effect for named in c.effects) for c in verdict.plausible[1:]]
    if not others:
        return rest
    return (
        f"{rest} Until it is found, {', '.join(others)} cannot be ruled out by weight alone; "
        f"a record over another range of {' and '.join(dict.fromkeys(variables))} would separate them."
    )


def weight(value: float) -> str:
    """A weight to two digits; what is below them is said to be."""
    return f"{value:.2f}" if value >= 0.01 else "< 0.01"


def _falls(verdict: Verdict) -> str:
    after, before, noise = verdict.error["after"], verdict.error["before"], verdict.error["noise"]
    parts = [
        f"{name} falls from {number(before[name])} to {number(after[name])} (noise {noise[name]:.2g})" for name in after
    ]
    return "the error of " + ", of ".join(parts)


def numbers(values: dict[str, float]) -> str:
    """Values by name, in a row."""
    return ", ".join(f"{number(value)} ({name})" for name, value in values.items())


def number(value: float) -> str:
    """An error; of a simulation that left the finite numbers in a word."""
    return f"{value:.3g}" if math.isfinite(value) else "infinite"


def _moved(verdict: Verdict) -> str:
    """Parameters that the data put elsewhere than the file, by more than two of their deviations and 1 %."""
    moved = [
        f"{name} {entry['before']:.4g} -> {entry['value']:.4g}"
        for name, entry in verdict.parameters.items()
        if abs(entry["value"] - entry["before"]) > max(2.0 * entry["sd"], 0.01 * abs(entry["before"]))
    ]
    return f" after refitting ({', '.join(moved)})" if moved else ""


def _family(verdict: Verdict, problem: Problem) -> str:
    """What all plausible effects share, if they do; shapes that stand for nothing in particular have no say."""
    families = {term.effect.id: term.effect.family for term in problem.terms}
    shared = [{families[named.effect] for named in candidate.effects} for candidate in verdict.plausible]
    shared = [family for family in shared if "" not in family]
    common = set.intersection(*shared) if len(shared) > 1 else set()
    return next((re.sub(r"\s+", " ", text) for text in sorted(common) if text), "")
