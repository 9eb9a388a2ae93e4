"""Units: equations that disagree with them are refused in a sentence, and what an effect brings along has its unit."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from suite import plugins
from suite.discovery.growing import grown
from suite.discovery.library import candidates
from suite.discovery.term_units import brought
from suite.discovery.terms import Term
from suite.errors import ModelError
from suite.model import Input, Model, Output, Parameter
from suite.model_file import from_toml, to_toml
from suite.quantities import compact, factor, unit
from suite.units import check

OSCILLATOR = Model(
    name="oscillator",
    states={"p": "v", "v": "(F - c*v - k*p)/m"},
    parameters={"m": Parameter(1.3, unit="kg"), "c": Parameter(0.5, unit="N*s/m"), "k": Parameter(8.0, unit="N/m")},
    inputs={"F": Input("force")},
    outputs={"pos": Output("p", "pos")},
    units={"t": "s", "p": "m", "v": "m/s", "F": "N"},
    source="plant.toml",
)
MUG = Model(
    name="mug",
    states={"T": "-k*(T - A)"},
    parameters={"k": Parameter(0.02, unit="1/min"), "A": Parameter(25.0, unit="degC")},
    outputs={"T": Output("T", "T")},
    units={"t": "min", "T": "degC"},
    source="plant.toml",
)


def changed(model: Model, state: str, rate: str, **units: str | None) -> Model:
    """The model with another rate, and with other units of its parameters; a new one has the value 1."""
    parameters = {n: replace(model.parameters.get(n, Parameter(1.0)), unit=text) for n, text in units.items()}
    return replace(
        model, states={**model.states, state: rate}, parameters={**model.parameters, **parameters}, effects=()
    )


CONSISTENT = {
    "given": OSCILLATOR,
    "other units of the same": changed(OSCILLATOR, "v", "(F - c*v - k*p)/m", c="kg/s", k="kg m/s^2/m"),
    "a name without a unit": changed(OSCILLATOR, "v", "F/m - q*p + r", m=None, q="1/s^2", r=None),
    "no unit of time": replace(OSCILLATOR, units={"p": "m", "v": "m/s"}),
    "functions of pure numbers": changed(
        OSCILLATOR, "v", "-g*tanh(p/w)*sign(v) + g*min(v/V, 1)", g="m/s^2", w="m", V="m/s"
    ),
    "an angle": changed(OSCILLATOR, "v", "-g*sin(phi) - g*cos(w*t)", g="m/s^2", phi="deg", w="rad/s"),
    "a number that converts": changed(OSCILLATOR, "v", "-k*p/(1000*m)", m="g", k="N/m"),
    "a root": changed(OSCILLATOR, "v", "-b*sqrt(max(p, 0)) - b*abs(p)**0.5", b="m^0.5/s^2"),
    "a temperature": MUG,
    "absolute temperatures": changed(MUG, "T", "-b*((T + 273.15)**4 - (A + 273.15)**4)", b="1/K^3/min"),
    "a loss by degree": changed(MUG, "T", "-h*(T - A)/C", h="W/degC", C="W*min/K"),
}


@pytest.mark.parametrize("model", CONSISTENT.values(), ids=CONSISTENT.keys())
def test_consistent_and_partial_units_are_not_complained_of(model: Model) -> None:
    """Also where only some names have a unit, and for angles, roots and scales of temperature."""
    check(model)


REFUSED = {
    "a factor is missing": (
        changed(OSCILLATOR, "v", "-k*p"),
        "plant.toml, [states] v: the term k*p is in N, but v' is in m/s^2; divide by a mass, or correct a unit",
    ),
    "no short name for what is missing": (
        changed(OSCILLATOR, "v", "-q*p", q="kg*mol/s^2"),
        "the term p*q is in kg*m*mol/s^2, but v' is in m/s^2; divide by what is in kg*mol, or correct a unit",
    ),
    "a number for a quantity": (
        changed(OSCILLATOR, "v", "-9.81 - k*p/m"),
        "the term 9.81 is a pure number, but v' is in m/s^2; make it a parameter with a unit",
    ),
    "a sum": (
        changed(OSCILLATOR, "v", "-k*(p + v)/m"),
        "[states] v: v is in m/s, but p beside it is in m; multiply by a time, or correct a unit",
    ),
    "one and a quantity": (
        changed(OSCILLATOR, "v", "-k*p*(1 + p)/m"),
        "1 is a pure number, but p beside it is in m; make it a parameter with a unit",
    ),
    "a function": (
        changed(OSCILLATOR, "v", "-k*p*exp(p)/m"),
        "exp takes a pure number, but p is in m; divide by a length, or correct a unit",
    ),
    "an exponent": (changed(OSCILLATOR, "v", "-2**p"), "an exponent is a pure number, but p is in m"),
    "a scale": (
        replace(OSCILLATOR, units={**OSCILLATOR.units, "t": "min"}),
        "[states] p: the term v is in m/s, but p' is in m/min; multiply by 60, or correct a unit",
    ),
    "a scale within": (
        changed(OSCILLATOR, "v", "-k*max(p - w, 0)/m", w="mm"),
        "w is in mm, but p beside it is in m; multiply by 0.001, or correct a unit",
    ),
    "an output": (
        replace(OSCILLATOR, outputs={"pos": Output("p + v", "pos")}),
        "[outputs] pos: v is in m/s, but p beside it is in m",
    ),
    "a delay": (
        replace(changed(OSCILLATOR, "v", "F/m", d="m"), inputs={"F": Input("force", delay="d")}),
        "[inputs] F delay: d is in m, but t is in s",
    ),
    "two scales of temperature": (changed(MUG, "T", "-k*(T - A)", A="degF"), "A is in °R, but T beside it is in K"),
    "no unit": (
        replace(OSCILLATOR, units={"p": "metre2"}),
        'plant.toml, [units] p: \'metre2\' is no unit that is known; write one such as "m", "N*s/m" or "1/s^2"',
    ),
    "a capital": (
        changed(OSCILLATOR, "v", "F/m", m="KG"),
        "[parameters] m unit: 'KG' is no unit that is known (did you mean kg?)",
    ),
    "a tower": (replace(OSCILLATOR, units={"p": "m^9^9^9^9"}), "'m^9^9^9^9' is no unit that is known"),
    "a number in it": (replace(OSCILLATOR, units={"p": "10 m"}), "'10 m' is no unit that is known"),
    "a logarithmic scale": (replace(OSCILLATOR, units={"p": "dB"}), "[units] p: 'dB' is no unit that is known"),
    "nobody's unit": (replace(OSCILLATOR, units={"p": "__import__('os')"}), "is no unit that is known"),
}


@pytest.mark.parametrize(("model", "sentence"), REFUSED.values(), ids=REFUSED.keys())
def test_a_contradiction_is_one_sentence(model: Model, sentence: str) -> None:
    """Place, what came, what was expected and the mend; also when the model comes from a file."""
    with pytest.raises(ModelError) as refusal:
        check(model)
    said = str(refusal.value)
    assert sentence in said
    assert said.startswith("plant.toml, [")
    assert "; " in said
    assert "\n" not in said
    with pytest.raises(ModelError) as read:
        from_toml(to_toml(model), "plant.toml")
    assert str(read.value) == said


def offered(model: Model, effect: str, equation: str) -> Term:
    """The first candidate of an effect in an equation."""
    library = {effect: plugins.effects()[effect]}
    return next(t for t in candidates(model, library, absolute=True) if t.equation == equation)


BROUGHT = {
    ("cubic_stiffness", "v"): {"a": "1/m^2/s^2"},
    ("coulomb_friction", "v"): {"a": "m/s^2", "w": "m/s"},
    ("stribeck_friction", "v"): {"a": "m/s^2", "b": "m/s^2", "w": "m/s", "s": "m/s"},
    ("harmonic_forcing", "v"): {"a": "m/s^2", "b": "m/s^2", "w": "rad/s"},
    ("bouc_wen_hysteresis", "v"): {"a": "1/s^2", "w": "m", "z": "m"},
    ("hard_stop", "v"): {"a": "1/s^2", "w": "m"},
    ("power_term", "v"): {"a": "m/s^2", "w": None, "s": "m/s"},
    ("input_delay", "F"): {"a": "s"},
    ("actuator_lag", "F"): {"a": None, "w": "s", "z": "N"},
    ("sensor_bias", "pos"): {"a": "m"},
    ("sensor_scale", "pos"): {"a": None},
    ("drifting_parameter", "v"): {"a": "kg/s"},
    ("clock_rate", "t"): {"a": None},
}


@pytest.mark.parametrize(("key", "units"), BROUGHT.items(), ids=[key[0] for key in BROUGHT])
def test_what_an_effect_brings_along_has_its_unit(key: tuple[str, str], units: dict[str, str | None]) -> None:
    """The coefficient's is the rate's by the term's; scales and states have those of what they measure."""
    assert brought(offered(OSCILLATOR, *key), OSCILLATOR) == units


def test_units_of_temperature_are_those_of_differences_except_for_places() -> None:
    """1/K in an exponent, K for a bias, degC for the reading at which a sensor clips."""
    assert brought(offered(MUG, "evaporation", "T"), MUG) == {"a": "K/min", "w": "1/K"}
    assert brought(offered(MUG, "second_compartment", "T"), MUG) == {"a": "1/min", "w": "min", "z": "K"}
    sensor = next(t for t in candidates(MUG, plugins.effects()) if t.effect.id == "sensor_saturation")
    assert brought(sensor, MUG)["w"] == "degC"


def test_a_model_without_units_gives_none() -> None:
    """Nothing is invented."""
    bare = replace(OSCILLATOR, units={}, parameters={n: Parameter(1.0) for n in OSCILLATOR.parameters})
    assert brought(offered(bare, "cubic_stiffness", "v"), bare) == {"a": None}


@pytest.mark.parametrize("model", [OSCILLATOR, MUG], ids=["oscillator", "mug"])
def test_every_grown_model_has_units_that_agree_and_a_file_that_reads_back(model: Model) -> None:
    """Whatever the library adds, the amended model passes the check that its file is read with."""
    for term in candidates(model, plugins.effects()):
        numbers = {name: Parameter(1.0) for name in (*term.names, *term.states)}
        new = grown(model, [term], [numbers])
        units = brought(term, model)
        assert {n: p.unit for n, p in new.parameters.items() if n in term.counted} == {
            n: units[n] for n in term.counted
        }
        assert from_toml(to_toml(new), "plant.toml") == new


NAMES = st.sampled_from(["m", "mm", "kg", "s", "min", "N", "rad", "K", "V", "Ohm", "mol", "Pa", "%", "l"])
POWERS = st.sampled_from(["", "^2", "^-1", "^0.5", "**3"])


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(NAMES, POWERS, st.sampled_from(["*", "/", " "])), min_size=1, max_size=4))
def test_a_unit_printed_is_the_unit_read(parts: list[tuple[str, str, str]]) -> None:
    """Text -> unit -> compact text -> the same unit."""
    text = "".join(f"{joint if i else ''}{name}{power}" for i, (name, power, joint) in enumerate(parts))
    first = unit(text)
    assert first is not None
    again = unit(compact(first) or "1")
    assert again is not None
    assert factor(first, again) == pytest.approx(1.0)
