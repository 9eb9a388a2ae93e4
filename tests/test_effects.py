"""The contract of an effect, on every one of the library: offered where its roles are played, gone at coefficient zero,
differentiated exactly, and the same in the engine, in the amended model and in its file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from suite import plugins
from suite.discovery.engine import Problem
from suite.discovery.fit import EXACT, prepare
from suite.discovery.frame import Layout, Point
from suite.discovery.growing import grown
from suite.discovery.library import candidates
from suite.discovery.misfit import simulate
from suite.discovery.terms import Term
from suite.model import Initial, Input, Model, Output, Parameter
from suite.model_file import from_toml, to_toml
from suite.record import Record

Array = npt.NDArray[np.float64]

EFFECTS = plugins.effects()
SAMPLES = 60
LATE = 2.4  # samples, away from whole ones, where a delayed input has corners
# Three plants that play every role between them.
MODELS = {
    "arm": Model(
        "arm",
        {"th": "w", "w": "(F - c*w - k*th)/m"},
        {"m": Parameter(1.2, fixed=True), "c": Parameter(0.3), "k": Parameter(4.0)},
        {"F": Input("F")},
        {"pos": Output("th", "pos")},
        {"th": Initial(0.7), "w": Initial(0.4)},
    ),
    "mug": Model(
        "mug",
        {"T": "-b*(T - A) + q"},
        {"b": Parameter(0.3), "A": Parameter(20.0, unit="degC")},
        {"q": Input("q", "linear")},
        {"T": Output("T", "T")},
        {"T": Initial(80.0)},
    ),
    "vessels": Model(
        "vessels",
        {"x": "q - r*x", "y": "r*x - s*y", "z": "s*y - r*z"},
        {"r": Parameter(0.8), "s": Parameter(0.5)},
        {"q": Input("q")},
        {"x": Output("x", "x"), "z": Output("z", "z")},
        {"x": Initial(3.0), "y": Initial(1.0), "z": Initial(0.5)},
    ),
}


@cache
def problem(plant: str) -> Problem:
    """A plant beside its own record, with every candidate of the library."""
    model = MODELS[plant]
    t = 0.1 * np.arange(SAMPLES)
    u = (2.0 + np.sin(1.7 * t) + 0.5 * np.cos(4.1 * t))[:, None]
    still = Record(t, u, np.zeros((SAMPLES, len(model.outputs))))
    y = simulate(model, still)
    y = y + 0.01 * y.std(axis=0) * np.random.default_rng(1).standard_normal(y.shape)
    return prepare(model, replace(still, y=y), candidates(model, EFFECTS))


def offered(name: str) -> Iterator[tuple[Problem, int]]:
    """Every candidate that an effect gives on the three plants."""
    for plant in MODELS:
        here = problem(plant)
        for k, term in enumerate(here.terms):
            if term.effect.id == name:
                yield here, k


def everything(here: Problem, k: int) -> Layout:
    """Candidate k on; free are all first values, its own states' too, and all parameters, fixed and pinned ones too."""
    own = [*range(len(here.model.parameters)), *here.places(k)]
    layout = here.layout((k,), columns=np.array(own, dtype=np.int64))
    return replace(layout, free=np.arange(len(layout.states)))


def with_coefficients(here: Problem, k: int) -> Point:
    """The start with coefficients that change the outputs by about a tenth of their spread; a pinned one at 1."""
    term, start = here.terms[k], here.start
    p = start.p.copy()
    layout = everything(here, k)
    J = here.run(start, 0.0, layout).J
    edge = J.shape[1] - len(here.places(k))
    size = float(np.sqrt(np.mean(np.var(here.record.y / np.sqrt(here.R), axis=0))))
    for i, place in enumerate(here.places(k)[: len(term.coefficients)]):
        response = float(np.sqrt(np.mean(J[:, edge + i] ** 2)))
        p[place] = 0.1 * size / response
        if term.effect.pinned:
            p[place] = 1.0
        if "__late" in term.text:
            p[place] = LATE * here.step
    x0 = start.x0.copy()
    # A memory that starts at zero starts at a corner of its rate.
    x0[:, here.states(k)] += [0.03 if z[1] == "0" else 0.0 for z in term.states.values()]
    return Point(x0, p)


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_a_candidate_in_each_of_its_forms(name: str) -> None:
    """Some plant that plays its roles is offered the effect, each of its forms, under a sentence and a dimension."""
    effect = EFFECTS[name]
    terms: list[Term] = [here.terms[k] for here, k in offered(name)]
    signs = {form[0] for form in (effect.term, *effect.forms)}
    assert signs <= {"+", "-"}
    assert len({term.text for term in terms}) >= 1 + len(effect.forms)
    assert {term.text[0] for term in terms} == signs
    assert effect.sentence.endswith(".")
    assert effect.dimension


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_gone_at_coefficient_zero(name: str) -> None:
    """Switched on with coefficient zero it changes no output by 1e-9 of its noise; with one that is not, it does.

    A state that comes along may ask for shorter integration steps, which move the outputs by the integrator's error.
    """
    for here, k in offered(name):
        without = here.run(here.start, 0.0).Y
        gone = here.run(here.start, 0.0, here.layout((k,))).Y
        there = here.run(with_coefficients(here, k), 0.0, here.layout((k,))).Y
        allowed = 2.0 * EXACT if here.terms[k].states else 1e-9
        assert np.max(np.abs(gone - without) / np.sqrt(here.R)) < allowed
        assert np.max(np.abs(there - without) / np.sqrt(here.R)) > 0.1


@pytest.mark.parametrize("name", EFFECTS)
def test_the_jacobian_of_an_effect_is_the_difference_quotient(name: str) -> None:
    """By first values, its own states' among them, by the model's parameters, its coefficients and inner scales."""
    for here, k in offered(name):
        point, layout = with_coefficients(here, k), everything(here, k)
        J = here.run(point, 0.0, layout).J
        theta = here.pack(point, layout)
        for j, value in enumerate(theta):
            step = 1e-6 * (abs(value) or 1.0)
            ends = []
            for sign in (1.0, -1.0):
                moved = theta.copy()
                moved[j] += sign * step
                there = here.unpack(moved, point, layout)
                # A reference scale is held in place by its bounds; its slope must be right all the same.
                there.p[layout.columns] = moved[len(moved) - len(layout.columns) :]
                ends.append(here.run(there, 0.0, layout).e)
            quotient = (ends[0] - ends[1]) / (2.0 * step)
            size = max(float(np.abs(quotient).max()), 1e-3)
            assert np.abs(J[:, j] - quotient).max() <= 1e-4 * size, (here.terms[k].text, j)


@pytest.mark.parametrize("name", EFFECTS)
def test_the_amended_model_read_back_from_its_file_does_what_the_candidate_did(name: str) -> None:
    """Engine with the candidate on = model grown by it and written and read, to 1e-6 of the noise."""
    for here, k in offered(name):
        term, point = here.terms[k], with_coefficients(here, k)
        numbers = {n: Parameter(float(point.p[j]), free=True) for n, j in zip(term.names, here.places(k), strict=True)}
        numbers |= {z: Parameter(float(point.x0[0, i])) for z, i in zip(term.states, here.states(k), strict=True)}
        new = grown(here.model, [term], [numbers])
        again = from_toml(to_toml(new), "plant.toml")
        assert again == new
        layout = here.layout((k,))
        x0 = point.x0[:, layout.states]
        assert [new.initial[s].value for s in new.states] == pytest.approx(x0[0].tolist())
        alone = Problem(
            again, here.record, (), here.R, Point(x0, again.values), np.zeros(x0.shape[1], dtype=bool),
            np.zeros(x0.shape[1]), substeps=here.substeps,
        )  # fmt: skip
        gap = alone.run(alone.start, 0.0).Y - here.run(point, 0.0, layout).Y
        assert np.max(np.abs(gap) / np.sqrt(here.R)) < 1e-6, term.text
