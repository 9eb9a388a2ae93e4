"""Units are a choice: in any of them verdict and weights are the same, and coefficients follow their dimension."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from suite import plugins
from suite.discovery.result import Verdict
from suite.discovery.verdict import diagnose
from suite.model import Model
from suite.model_file import from_toml
from suite.record import Record

# A free power has a test of its own.
EFFECTS = {name: effect for name, effect in plugins.effects().items() if name != "power_term"}


@dataclass(frozen=True)
class Units:
    """How many of the new unit make one of the old, of each quantity of a plant."""

    state: float = 1.0
    output: float = 1.0
    input: float = 1.0
    time: float = 1.0


def vessels(at: Units) -> Model:
    """Two vessels in a row, of which the second is measured: x' = q - r x, y' = r x - s y, in any units."""
    X, Y, U, T = at.state, at.output, at.input, at.time
    return from_toml(
        f"""
        [states]
        x = "{X / (U * T)!r}*q - r*x"
        y = "{Y / X!r}*r*x - s*y"
        [parameters]
        r = {{ value = {0.8 / T!r}, sd = {0.04 / T!r} }}
        s = {{ value = {0.3 / T!r}, sd = {0.015 / T!r} }}
        [inputs]
        q = "q"
        [outputs]
        level = "y"
        [initial]
        x = 0.0
        y = 0.0
        """
    )


def oscillator(at: Units) -> Model:
    """A driven mass of which the position is measured in units of its own: p' = v, v' = F - c v - k p."""
    X, Y, U, T = at.state, at.output, at.input, at.time
    return from_toml(
        f"""
        [states]
        p = "v"
        v = "{X / (U * T**2)!r}*F - c*v - k*p"
        [parameters]
        c = {{ value = {0.3 / T!r}, sd = {0.03 / T!r} }}
        k = {{ value = {1.0 / T**2!r}, sd = {0.05 / T**2!r} }}
        [inputs]
        F = "F"
        [outputs]
        pos = "{Y / X!r}*p"
        [initial]
        p = 0.0
        v = 0.0
        """
    )


# What the plant has beside its model, with the powers of (state, output, time) in the coefficient's unit.
PLANTS = {
    "vessels": (vessels, "y", "-0.25*y*y", 0.25, (0, -1, -1)),
    "oscillator": (oscillator, "v", "-0.3*p**3", 0.3, (-2, 0, -2)),
}


@cache
def measured(plant: str) -> Record:
    """The plant under a staircase of inputs, in the old units, with 2 % of noise."""
    build, equation, term, _, _ = PLANTS[plant]
    return run(plant, build(Units()).plus(equation, term))


def run(plant: str, truth: Model) -> Record:
    """What is measured of any plant with the same states."""
    rng = np.random.default_rng(1)
    t = 0.2 * np.arange(180)
    u = np.repeat(rng.uniform(-1.0, 2.0, 18), 10)[:, None]
    x = [np.zeros(2)]
    for k in range(len(t) - 1):
        x.append(truth.step(t[k], x[-1], u[k], 0.2))
    y = np.array(x)[:, [1 if plant == "vessels" else 0]]
    return Record(t, u, y + 0.02 * y.std() * rng.standard_normal(y.shape))


@cache
def verdict(plant: str, at: Units) -> Verdict:
    """The verdict on the same measurements, taken down in other units."""
    record = measured(plant)
    scaled = Record(at.time * record.t, at.input * record.u, at.output * record.y)
    return diagnose(PLANTS[plant][0](at), scaled, EFFECTS)


QUANTITIES = ("state", "output", "input", "time")


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("power", [-9, 9])
def test_a_verdict_does_not_depend_on_units(plant: str, quantity: str, power: int) -> None:
    """Same verdict and effects, weights to 1e-6, coefficients and their deviations in step to 1e-3."""
    at = Units(**{quantity: 10.0**power})
    plain, scaled = verdict(plant, Units()), verdict(plant, at)
    _, _, _, true, (state, output, time) = PLANTS[plant]
    assert plain.effects[0].coefficients["a"].value == pytest.approx(true, rel=0.15)
    assert scaled.verdict == plain.verdict
    assert [(e.effect, e.equation) for e in scaled.effects] == [(e.effect, e.equation) for e in plain.effects]
    assert scaled.weight == pytest.approx(plain.weight, abs=1e-6)
    weights = [
        {(c.effects[0].effect, c.effects[0].equation): c.weight for c in v.plausible if len(c.effects) == 1}
        for v in (plain, scaled)
    ]
    assert weights[1] == pytest.approx(weights[0], abs=1e-6)
    unit = at.state**state * at.output**output * at.time**time
    a, b = plain.effects[0].coefficients["a"], scaled.effects[0].coefficients["a"]
    assert b.value == pytest.approx(unit * a.value, rel=1e-3)
    assert b.sd == pytest.approx(unit * a.sd, rel=1e-3)


@pytest.mark.parametrize("power", [-9, 9])
def test_the_exponent_of_a_power_law_does_not_depend_on_units(power: int) -> None:
    """A loss with the power 2.6: the same exponent in every unit, to 1e-3."""
    record = run("vessels", vessels(Units()).plus("y", "-0.4*sign(y)*abs(y)**2.6"))
    library = {name: plugins.effects()[name] for name in ("power_term", "sensor_bias")}
    exponents = []
    for at in (Units(), Units(output=10.0**power)):
        found = diagnose(vessels(at), Record(record.t, record.u, at.output * record.y), library)
        exponents.append(next(c.effects[0] for c in found.plausible).coefficients["w"].value)
    assert exponents[0] == pytest.approx(2.6, abs=0.2)
    assert exponents[1] == pytest.approx(exponents[0], rel=1e-3)
