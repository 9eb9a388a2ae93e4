"""Records that break an analysis: degenerate, tiny, huge, wrapped, short. A verdict stays right or is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from suite import plugins
from suite.benchmark.conditions import trial
from suite.discovery import checkup, misfit
from suite.discovery.fit import fit, prepare
from suite.discovery.verdict import diagnose
from suite.errors import DataError
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Record, join

EFFECTS = plugins.effects()
LINEAR = Model(
    "oscillator",
    {"p": "v", "v": "-c*v - k*p"},
    {"c": Parameter(0.3, sd=0.03), "k": Parameter(4.0, sd=0.2)},
    outputs={"pos": Output("p", "pos")},
    initial={"p": Initial(2.0), "v": Initial(0.0)},
)
COMPLETE = replace(LINEAR, states={"p": "v", "v": "-c*v - k*p - 0.8*p**3"})


def duffing(samples: int = 200, length: float = 12.0, noise: float = 0.01, seed: int = 1) -> Record:
    """An oscillator with a hardening spring, let go at 2; noise as a fraction of its spread."""
    t = np.linspace(0.0, length, samples)
    y = solve_ivp(
        lambda _, x: [x[1], -0.3 * x[1] - 4.0 * x[0] - 0.8 * x[0] ** 3], (0.0, length), [2.0, 0.0], "DOP853", t,
        rtol=1e-11, atol=1e-12,
    ).y[0]  # fmt: skip
    y = y + noise * y.std() * np.random.default_rng(seed).standard_normal(samples)
    return Record(t, np.zeros((samples, 0)), y[:, None])


@pytest.mark.parametrize(
    "model",
    [
        replace(LINEAR, suspect=()),
        replace(LINEAR, states={"p": "v", "v": "p"}, parameters={}),
    ],
)
def test_a_model_that_fails_where_nothing_may_be_wrong_is_unexplained(model: Model) -> None:
    """No suspect equation, or definitions alone: an error of thirty noise deviations is not called adequate."""
    assert diagnose(model, duffing(), EFFECTS).verdict == "unexplained"


@pytest.mark.parametrize("power", [-9, 9])
@pytest.mark.parametrize("what", ["length", "time"])
def test_units_of_any_size_change_no_verdict(power: int, what: str) -> None:
    """Values or seconds of 1e-9 and 1e9: the cubic spring is found with the same weight, its coefficient in step."""
    unit = 10.0**power
    record = duffing()
    if what == "length":
        model = replace(LINEAR, initial={"p": Initial(2.0 * unit), "v": Initial(0.0)})
        record, factor = replace(record, y=record.y * unit), unit**2
    else:
        values = {"c": Parameter(0.3 / unit, sd=0.03 / unit), "k": Parameter(4.0 / unit**2, sd=0.2 / unit**2)}
        model, record, factor = replace(LINEAR, parameters=values), replace(record, t=record.t * unit), unit**2
    verdict = diagnose(model, record, EFFECTS)
    assert [e.effect for e in verdict.effects] == ["cubic_stiffness"]
    assert verdict.weight > 0.99
    assert verdict.effects[0].coefficients["a"].value * factor == pytest.approx(0.8, rel=0.02)


def test_exact_data_of_a_complete_model_show_nothing_missing() -> None:
    """Without noise the integrator's own error is no missing effect, and the removed spring is found exactly."""
    record = duffing(noise=0.0)
    assert diagnose(COMPLETE, record, EFFECTS).verdict == "adequate"
    verdict = diagnose(LINEAR, record, EFFECTS)
    assert [e.effect for e in verdict.effects] == ["cubic_stiffness"]
    assert verdict.effects[0].coefficients["a"].value == pytest.approx(0.8, rel=1e-5)


def test_five_samples_name_no_effect() -> None:
    """As many parameters as samples fit anything: no effect is named with a weight; fewer samples are refused."""
    verdict = diagnose(LINEAR, duffing(5, 6.0), EFFECTS)
    assert verdict.verdict != "missing_effect"
    with pytest.raises(DataError, match="cannot determine"):
        diagnose(LINEAR, duffing(3, 6.0), EFFECTS)


def test_constant_outputs_are_refused() -> None:
    """A record in which nothing moves names no effect; `check` says why."""
    still = replace(duffing(), y=np.ones((200, 1)))
    with pytest.raises(DataError, match="never changes"):
        diagnose(LINEAR, still, EFFECTS)
    assert any("never changes" in finding for finding in checkup.check(LINEAR, still).findings)


def test_an_output_may_be_missing_from_one_run() -> None:
    """The rate was measured in the first of two runs only; both serve."""
    first, second = duffing(150, 9.0), duffing(100, 6.0, seed=2)
    model = replace(LINEAR, outputs={**LINEAR.outputs, "vel": Output("v", "vel")}, initial={})
    vel = np.gradient(first.y[:, 0], first.t)
    both = join(
        [
            replace(first, y=np.column_stack([first.y, vel])),
            replace(second, y=np.column_stack([second.y, np.full(100, np.nan)])),
        ]
    )
    fitted = fit(replace(model, states=COMPLETE.states), both)
    assert fitted.parameters["k"][0] == pytest.approx(4.0, rel=0.05)
    assert np.isfinite(misfit.compare(fitted.model, both).Y).all()


def test_an_angle_is_compared_in_its_own_turn() -> None:
    """A rotor measured within +-pi: the right model's error is its noise, not a turn, and so is the noise found."""
    t = np.linspace(0.0, 20.0, 400)
    states = {"th": "w", "w": "2 - 0.2*w - sin(th)"}
    x = solve_ivp(
        lambda _, x: [x[1], 2.0 - 0.2 * x[1] - math.sin(x[0])], (0.0, 20.0), [0.0, 0.0], t_eval=t, rtol=1e-9
    ).y[0]
    y = x + 0.02 * np.random.default_rng(4).standard_normal(400)
    model = Model("rotor", states, outputs={"a": Output("th", "a", angle=True)})
    record = Record(t, np.zeros((400, 0)), (np.arctan2(np.sin(y), np.cos(y)))[:, None])
    found = misfit.compare(model, record)
    assert found.error["a"] == pytest.approx(0.02, rel=0.15)
    assert found.sigma[0] == pytest.approx(0.02, rel=0.2)


def test_coarse_samples_are_integrated_finely() -> None:
    """Steps between samples follow the noise: one where it hides the integrator, more where it does not."""
    assert prepare(COMPLETE, duffing(noise=0.05)).substeps == 1
    quiet = replace(COMPLETE, outputs={"pos": Output("p", "pos", sigma=1e-4)})
    assert prepare(quiet, duffing(samples=60, noise=1e-4)).substeps > 1


def test_check_names_what_contradicts_the_file() -> None:
    """A first state that the data refute, a sigma far from the scatter, and an input held the wrong way."""
    record = duffing()
    wrong = replace(LINEAR, initial={"p": Initial(1.5), "v": Initial(0.0)})
    assert any("p starts at 1.5" in finding for finding in checkup.check(wrong, record).findings)
    noisy = replace(LINEAR, outputs={"pos": Output("p", "pos", sigma=1.0)})
    assert any("sigma = 1" in finding for finding in checkup.check(noisy, record).findings)

    t = np.linspace(0.0, 20.0, 200)
    u = np.random.default_rng(2).standard_normal(200)
    lag = Model("lag", {"x": "F - k*x"}, {"k": Parameter(1.0)}, {"F": Input("F", "linear")}, {"x": Output("x", "x")})
    held = Record(t, u[:, None], np.zeros((200, 1)))
    y = misfit.simulate(replace(lag, initial={"x": Initial(0.0)}), held)
    held = replace(held, y=y + 1e-3 * np.random.default_rng(3).standard_normal(y.shape))
    assert not any("hold" in finding for finding in checkup.check(lag, held).findings)
    other = replace(lag, inputs={"F": Input("F", "previous")})
    assert any('hold = "linear"' in finding for finding in checkup.check(other, held).findings)


@pytest.mark.parametrize("name", ["stribeck-joint", "slider-friction"])
def test_friction_that_turns_within_a_sample_needs_no_second_effect(name: str) -> None:
    """At 1 % noise one integration step a sample errs by more than the noise, which a further effect would imitate."""
    here = trial(plugins.cases()[name], "missing", 0.01, 2, plugins.effects())
    verdict = diagnose(here.model, here.record, here.effects)
    assert {(named.effect, named.equation) for named in verdict.effects} == here.truth
    assert verdict.weight > 0.9


def test_an_epidemic_has_one_flow_and_not_two_effects() -> None:
    """Immunity that wanes takes from one store what it gives to another."""
    here = trial(plugins.cases()["epidemic-waning"], "missing", 0.05, 1, plugins.effects())
    verdict = diagnose(here.model, here.record, here.effects)
    assert [(named.effect, named.equation, named.term) for named in verdict.effects] == [
        ("transfer", "S", "+a*R, which R loses")
    ]
    rate = verdict.effects[0].coefficients["a"]
    assert abs(rate.value - 0.012) < 4 * rate.sd
