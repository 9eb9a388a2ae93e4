"""A Model is its equations; everything else follows from them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from suite.errors import ModelError
from suite.model import Initial, Input, Model, Output, Parameter

OSCILLATOR = Model(
    name="oscillator",
    states={"p": "v", "v": "(F - c*v - k*p)/m"},
    parameters={"m": Parameter(1.3, fixed=True), "c": Parameter(0.5, sd=0.1), "k": Parameter(8.0)},
    inputs={"F": Input("force")},
    outputs={"pos": Output("p", "pos")},
)

# One model with every function whose derivative is not smooth everywhere, compiled once.
WIDE = Model(
    name="wide",
    states={
        "x": "-a*abs(x)*x + b*tanh(y/c) + min(x, y) - u*exp(-x**2)",
        "y": "max(x*y, u) + sign(y)*y**2 + (1 + x**2)**0.3 - atan2(y, 2 + x**2) + sqrt(1 + abs(y)) + log(2 + y**2)",
        "z": "sin(a*t)*x**3/(1 + b**2) - abs(y)**1.5 + y/(1 + c**2) + max(z, -z) + a**b",
    },
    parameters={"a": Parameter(0.7), "b": Parameter(1.2), "c": Parameter(0.9)},
    inputs={"u": Input("u")},
    outputs={"first": Output("x*abs(y) + z**2", "first"), "second": Output("max(a*x, min(y, u)) + cosh(z)", "second")},
)


def test_a_rate_that_is_a_state_is_a_definition_and_not_suspect() -> None:
    """The rate p' = v is exact; the equation that holds the physics is in doubt."""
    assert OSCILLATOR.definitions == {"p"}
    assert OSCILLATOR.suspects == ("v",)
    assert dataclasses.replace(OSCILLATOR, suspect=("p",)).suspects == ("p",)


def test_a_prior_is_what_is_known_of_a_parameter() -> None:
    """Fixed is exact; no word is a weak prior of the value's own size; free or zero is no prior at all."""
    assert Parameter(2.0, fixed=True).prior_sd == 0.0
    assert Parameter(2.0, sd=0.3).prior_sd == 0.3
    assert Parameter(-2.0).prior_sd == 2.0
    assert Parameter(0.0).prior_sd == math.inf
    assert Parameter(2.0, free=True).prior_sd == math.inf


def test_an_effect_is_added_with_its_sign_and_its_parameter() -> None:
    """plus() gives a new model; the old one stays as it was."""
    grown = OSCILLATOR.plus("v", "-a*p**3", {"a": Parameter(2.0)})
    assert grown.states["v"] == "(F - c*v - k*p)/m - a*p**3"
    assert "a" not in OSCILLATOR.parameters
    x = np.array([0.5, -0.2])
    assert grown.rate(0.0, x, [1.0])[1] == pytest.approx(OSCILLATOR.rate(0.0, x, [1.0])[1] - 2.0 * 0.125)
    biased = OSCILLATOR.plus("pos", "b", {"b": Parameter(0.1)})
    assert biased.output(0.0, x, [1.0])[0] == pytest.approx(0.6)
    with pytest.raises(ModelError, match="choose one of p, v, pos"):
        OSCILLATOR.plus("w", "a", {"a": Parameter(0.0)})


def test_a_disturbance_state_is_constant_and_adds_to_the_rate() -> None:
    """with_disturbance() augments each named rate by a state that nothing drives."""
    grown = OSCILLATOR.with_disturbance(["v"])
    assert list(grown.states) == ["p", "v", "d_v"]
    assert grown.initial["d_v"] == Initial(0.0, estimate=True)
    rate = grown.rate(0.0, np.array([0.5, -0.2, 3.0]), [1.0])
    before = OSCILLATOR.rate(0.0, np.array([0.5, -0.2]), [1.0])
    np.testing.assert_allclose(rate, [before[0], before[1] + 3.0, 0.0])


def test_other_values_keep_what_is_known() -> None:
    """with_values() moves numbers, not priors."""
    moved = OSCILLATOR.with_values({"c": 0.7})
    assert moved.parameters["c"] == Parameter(0.7, sd=0.1)
    np.testing.assert_array_equal(moved.values, [1.3, 0.7, 8.0])


def test_latex_holds_every_equation() -> None:
    """One aligned line a rate and one an output."""
    text = OSCILLATOR.latex()
    assert text.count("&=") == 3
    assert r"\dot{v}" in text


NUMBER = st.floats(-2.0, 2.0).filter(lambda value: abs(value) > 0.05)


@settings(max_examples=80, deadline=None)
@given(st.tuples(NUMBER, NUMBER, NUMBER), NUMBER, st.floats(0.0, 3.0))
def test_derivatives_are_difference_quotients(x: tuple[float, ...], u: float, t: float) -> None:
    """Every generated Jacobian agrees with central differences wherever the functions are smooth."""
    state, p, step = np.array(x), WIDE.values, 1e-6
    kinks = [x[0] - x[1], x[0] * x[1] - u, x[1] - u, 0.7 * x[0] - min(x[1], u)]
    if min(abs(kink) for kink in kinks) < 1e-4:
        return
    for values in (WIDE.program.rates, WIDE.program.outputs):
        _, by_x, by_p = values(t, state, [u], p)
        for j in range(3):
            e = np.eye(3)[j] * step
            quotient = (values(t, state + e, [u], p)[0] - values(t, state - e, [u], p)[0]) / (2 * step)
            np.testing.assert_allclose(by_x[:, j], quotient, rtol=1e-6, atol=1e-7)
            quotient = (values(t, state, [u], p + e)[0] - values(t, state, [u], p - e)[0]) / (2 * step)
            np.testing.assert_allclose(by_p[:, j], quotient, rtol=1e-6, atol=1e-7)


def test_steps_have_slope_zero_and_the_middle_value_at_the_step() -> None:
    """sign(0) is 0, and no derivative of a step is infinite or NaN."""
    model = Model("rub", {"v": "-c*sign(v) + max(v, 0)"}, {"c": Parameter(2.0)})
    for v, rate in ((-1.0, 2.0), (0.0, 0.0), (1.0, -1.0)):
        assert model.rate(0.0, np.array([v]))[0] == rate
        assert math.isfinite(model.jacobian(0.0, np.array([v]))[0, 0])


def test_names_of_the_generated_code_are_free_for_models() -> None:
    """States may be called as the generated functions' own arguments are."""
    names = ["x", "u", "p", "dx", "math", "on", "Fx", "y", "E", "I", "rate", "compile_kernel"]
    states = {name: f"-{k + 1}*{name}" for k, name in enumerate(names)}
    model = Model("names", states, outputs={"x": Output("x + math", "x")})
    x = np.linspace(1.0, 2.0, len(names))
    np.testing.assert_allclose(model.rate(0.0, x), -np.arange(1, len(names) + 1) * x)
    assert model.output(0.0, x)[0] == pytest.approx(x[0] + x[4])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"states": {}}, "no states"),
        ({"states": {"p": "v", "v": "q"}}, r"\[states\] v: 'q' is not declared"),
        ({"states": {"p": "v", "v v": "p"}}, "a name is letters"),
        ({"states": {"p": "v", "v": "0", "sin": "0"}}, "taken by the language"),
        ({"states": {"p": "v", "v": "0", "lambda": "0"}}, "taken by the language"),
        ({"parameters": {"p": Parameter(1.0)}}, r"already declared in \[states\]"),
        ({"initial": {"w": Initial(0.0)}}, r"\[initial\] w: no such state; it has p, v"),
        ({"suspect": ("w",)}, r"\[suspect\] w: no such state"),
        ({"outputs": {"pos": Output("p +", "pos")}}, r"\[outputs\] pos: 'p \+' is not an equation"),
    ],
)
def test_a_model_that_exists_makes_sense(change: dict[str, object], sentence: str) -> None:
    """What is wrong with a model is said when it is made, with its place."""
    with pytest.raises(ModelError, match=sentence):
        dataclasses.replace(OSCILLATOR, **change)


def test_a_step_follows_the_linear_hold() -> None:
    """The rate x' = u with u on a line from 0 to 2 over one second gives 1; held it gives 0."""
    line = Model("line", {"x": "u"}, inputs={"u": Input("u", "linear")})
    held = Model("held", {"x": "u"}, inputs={"u": Input("u")})
    assert line.step(0.0, np.zeros(1), [0.0], 1.0, [2.0])[0] == pytest.approx(1.0)
    assert held.step(0.0, np.zeros(1), [0.0], 1.0, [2.0])[0] == 0.0
