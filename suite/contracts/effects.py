"""What every effect must hold: offered where its roles are played, gone at coefficient zero, differentiated exactly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import get_args

import matplotlib
import numpy as np

from suite.contracts.outcome import BrokenContractError, NotApplicableError, demand
from suite.discovery.engine import Problem
from suite.discovery.fit import EXACT, prepare
from suite.discovery.frame import Layout, Point
from suite.discovery.library import candidates
from suite.discovery.misfit import simulate
from suite.effect import Effect, Role
from suite.errors import ModelError
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Record

SAMPLES, STEP = 60, 0.1
LATE = 2.4  # samples, away from whole ones, where a delayed input has corners
# Plants that play every role between them.
PLANTS = (
    Model(
        "arm",
        {"th": "w", "w": "(F - c*w - k*th)/m"},
        {"m": Parameter(1.2, fixed=True), "c": Parameter(0.3), "k": Parameter(4.0)},
        {"F": Input("F")},
        {"pos": Output("th", "pos")},
        {"th": Initial(0.7), "w": Initial(0.4)},
    ),
    Model(
        "mug",
        {"T": "-b*(T - A) + q"},
        {"b": Parameter(0.3), "A": Parameter(20.0, unit="degC")},
        {"q": Input("q", "linear")},
        {"T": Output("T", "T")},
        {"T": Initial(80.0)},
    ),
    Model(
        "vessels",
        {"x": "q - r*x", "y": "r*x - s*y", "z": "s*y - r*z"},
        {"r": Parameter(0.8), "s": Parameter(0.5)},
        {"q": Input("q")},
        {"x": Output("x", "x"), "z": Output("z", "z")},
        {"x": Initial(3.0), "y": Initial(1.0), "z": Initial(0.5)},
    ),
)


@cache
def _beside_a_record(number: int) -> tuple[Model, Record]:
    """A plant with a record of its own, of 1 % noise."""
    model = PLANTS[number]
    t = STEP * np.arange(float(SAMPLES))
    u = (2.0 + np.sin(1.7 * t) + 0.5 * np.cos(4.1 * t))[:, None]
    still = Record(t, u, np.zeros((SAMPLES, len(model.outputs))))
    y = simulate(model, still)
    y = y + 0.01 * y.std(axis=0) * np.random.default_rng(1).standard_normal(y.shape)
    return model, replace(still, y=y)


def _offered(effect: Effect) -> list[tuple[Problem, int]]:
    """Every candidate that the effect gives on the plants, beside a record each."""
    if effect.equation:
        raise NotApplicableError(f"it acts in {effect.equation} of one model alone")
    found = []
    for number in range(len(PLANTS)):
        model, record = _beside_a_record(number)
        terms = candidates(model, {effect.id: effect})
        if terms:
            problem = prepare(model, record, terms)
            found += [(problem, k) for k in range(len(terms))]
    return found


def words(effect: Effect) -> str:
    """A sentence of physics, a dimension, roles that exist, terms that open with their sign."""
    demand(effect.sentence.rstrip().endswith("."), f"the sentence {effect.sentence!r} does not end as one")
    demand(bool(effect.dimension), 'no dimension; write it in words of the roles, such as "rate/position"')
    for letter, role in effect.roles.items():
        demand(role in get_args(Role), f"the role {role!r} of {letter} is none of {', '.join(get_args(Role))}")
    for form in (effect.term, *effect.forms):
        demand(form[:1] in ("+", "-"), f"the term {form!r} does not open with its sign")
    return effect.dimension


def ranges(effect: Effect) -> str:
    """The sign is 0 or 1 and leaves coefficient zero, that is no effect, possible; inner scales start in range."""
    demand(effect.sign in (0, 1), f"sign = {effect.sign!r}, expected 1 (never negative) or 0")
    demand(effect.least <= 0.0, f"least = {effect.least:g} forbids the coefficient zero")
    for name, inner in effect.inner.items():
        demand(inner.low <= inner.start <= inner.high, f"{name} starts at {inner.start:g} outside its range")
        demand(all(math.isfinite(v) for v in (inner.low, inner.high)), f"{name} has no finite range")
        demand(bool(inner.tries), f"{name} has no start to try")
    return "never negative" if effect.sign else "either sign"


def offered(effect: Effect) -> str:
    """Some plant that plays its roles is offered it, in each of its forms."""
    found = _offered(effect)
    demand(bool(found), f"no plant plays its roles {', '.join(effect.roles.values())}")
    texts = list(dict.fromkeys(problem.terms[k].shown for problem, k in found))
    signs = {problem.terms[k].text[0] for problem, k in found}
    demand(signs == {form[0] for form in (effect.term, *effect.forms)}, "not every form is offered")
    demand(len(texts) >= 1 + len(effect.forms), f"{1 + len(effect.forms)} forms, but only {', '.join(texts)} offered")
    return ", ".join(texts[:3]) + (f" and {len(texts) - 3} more" if len(texts) > 3 else "")


def gone(effect: Effect) -> str:
    """At coefficient zero it changes no output; with another coefficient it does."""
    for here, k in _offered(effect):
        layout = here.layout((k,))
        without, off = here.run(here.start, 0.0).Y, here.run(here.start, 0.0, layout).Y
        on = here.run(_strong(here, k), 0.0, layout).Y
        # A state that comes along may ask for shorter steps, which move the outputs by the integrator's error.
        allowed = 2.0 * EXACT if here.terms[k].states else 1e-9
        left, moved = (float(np.max(np.abs(Y - without) / np.sqrt(here.R))) for Y in (off, on))
        demand(left < allowed, f"{here.terms[k].shown}: with coefficient zero outputs move by {left:.1e} of the noise")
        demand(moved > 0.1, f"{here.terms[k].shown}: no output moves, whatever the coefficient")
    return ""


def slopes(effect: Effect) -> str:
    """The compiled slopes of the outputs by all numbers of effect and model are the difference quotients."""
    worst = 0.0
    for here, k in _offered(effect):
        point, layout = _strong(here, k), _everything(here, k)
        J, theta = here.run(point, 0.0, layout).J, here.pack(point, layout)
        for j, value in enumerate(theta):
            step = 1e-6 * (abs(value) or 1.0)
            ends = []
            for moved in (value + step, value - step):
                there = here.unpack(np.where(np.arange(len(theta)) == j, moved, theta), point, layout)
                # A reference scale is held in place by its bounds; its slope must be right all the same.
                at = j - (len(theta) - len(layout.columns))
                if at >= 0:
                    there.p[layout.columns[at]] = moved
                ends.append(here.run(there, 0.0, layout).e)
            quotient = (ends[0] - ends[1]) / (2.0 * step)
            gap = float(np.abs(J[:, j] - quotient).max()) / max(float(np.abs(quotient).max()), 1e-3)
            if not gap <= 1e-4:
                raise BrokenContractError(f"{here.terms[k].shown}: slope {j} is off by {gap:.1e} of its largest value")
            worst = max(worst, gap)
    return f"to {worst:.0e}"


def picture(effect: Effect) -> str:
    """Its picture can be drawn, with finite numbers."""
    from suite.report.effect_figures import effect_figure
    from suite.report.effect_trace import trace

    with matplotlib.rc_context():
        try:
            found = trace(effect)
            demand(bool(np.all(np.isfinite(found.d))), "along a typical motion its term is not finite")
            effect_figure(effect)
        except ModelError as error:
            raise BrokenContractError(str(error)) from None
    demand(bool(np.any(found.d)), "along a typical motion its term is zero")
    return ""


def _everything(here: Problem, k: int) -> Layout:
    """Candidate k on; free are all first values, its own states' too, and all parameters, fixed and pinned ones too."""
    own = [*range(len(here.model.parameters)), *here.places(k)]
    layout = here.layout((k,), columns=np.array(own, dtype=np.int64))
    return replace(layout, free=np.arange(len(layout.states)))


def _strong(here: Problem, k: int) -> Point:
    """The start with coefficients that change the outputs by about a tenth of their spread; a pinned one at 1."""
    term, p, x0 = here.terms[k], here.start.p.copy(), here.start.x0.copy()
    J = here.run(here.start, 0.0, _everything(here, k)).J
    edge = J.shape[1] - len(here.places(k))
    size = float(np.sqrt(np.mean(np.var(here.record.y / np.sqrt(here.R), axis=0))))
    for i, place in enumerate(here.places(k)[: len(term.coefficients)]):
        response = float(np.sqrt(np.mean(J[:, edge + i] ** 2)))
        p[place] = 0.1 * size / response if response > 0 else 1.0
        if term.effect.pinned:
            p[place] = 1.0
        if "__late" in term.text:
            p[place] = LATE * here.step
    # A memory that starts at zero starts at a corner of its rate.
    x0[:, here.states(k)] += [0.03 if start == "0" else 0.0 for _, start, _ in term.states.values()]
    return Point(x0, p)


CHECKS: dict[str, Callable[[Effect], str]] = {
    "words": words,
    "sign and ranges": ranges,
    "candidates": offered,
    "gone at zero": gone,
    "slopes": slopes,
    "picture": picture,
}
