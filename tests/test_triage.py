"""Before physics: a fault of a sensor, an input, a fixed number or the clock is found there, and not in the plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from suite import plugins
from suite.case import Case
from suite.discovery.checkup import check
from suite.discovery.verdict import diagnose
from suite.model import Input, Model, Parameter
from suite.record import Record

EFFECTS = plugins.effects()
NULL = plugins.cases()["null-oscillator"]
MODEL = NULL.deficient
NOISE = 0.01


def plain(truth: Model = MODEL, seed: int = 1, model: Model = MODEL) -> Record:
    """The driven oscillator measured, or another plant with the same sensor and input."""
    assert NULL.experiment is not None
    start = (0.0,) * len(truth.states)
    case = replace(NULL, deficient=model, truth=truth, experiment=replace(NULL.experiment, x0=start))
    return case.simulate(NOISE, seed)[0]


def late() -> tuple[Model, Record]:
    """The force, held over each sample, acts 2.5 samples later than it is recorded; before that it was constant."""
    record = plain(seed=2)
    half = 0.5 * float(record.t[1] - record.t[0])
    x, path = np.zeros(2), []
    for j in range(2 * len(record)):
        if j % 2 == 0:
            path.append(x[0])
        x = MODEL.step(j * half, x, record.u[max(j - 5, 0) // 2], half)
    clean = np.array(path)[:, None]
    noise = NOISE * clean.std() * np.random.default_rng(3).standard_normal(clean.shape)
    return MODEL, replace(record, y=clean + noise)


def held() -> tuple[Model, Record]:
    """A force that is held over each sample, in a model that lets it run on a line."""
    return replace(MODEL, inputs={"F": Input("force", "linear")}), plain()


def fast() -> tuple[Model, Record]:
    """A time column that runs 3 % fast."""
    record = plain()
    return MODEL, replace(record, t=1.03 * record.t)


def clipped() -> tuple[Model, Record]:
    """A sensor that clips in the upper fifth of its range."""
    record = plain()
    top = float(record.y.min() + 0.8 * np.ptp(record.y))
    return MODEL, replace(record, y=np.minimum(record.y, top))


def sensor(term: str, value: float) -> tuple[Model, Record]:
    """A sensor whose reading has another term."""
    return MODEL, plain(MODEL.plus("pos", term, {"a": Parameter(value)}))


def lagging() -> tuple[Model, Record]:
    """An actuator that follows its command with a lag."""
    case: Case = plugins.cases()["oscillator-actuator-lag"]
    return MODEL, case.simulate(NOISE, 1)[0]


FAULTS: dict[str, tuple[Callable[[], tuple[Model, Record]], set[str]]] = {
    "sensor bias": (lambda: sensor("+a", 0.3), {"sensor_bias"}),
    # In a linear plant a sensor's scale and an input's gain are one.
    "sensor scale": (lambda: sensor("+a*p", 0.2), {"sensor_scale", "missing_input_gain"}),
    "input delay": (late, {"input_delay"}),
    "input hold": (held, {"input_hold"}),
    "lag": (lagging, {"actuator_lag", "sensor_lag"}),
    "wrong value": (lambda: (MODEL, plain(MODEL.with_values({"m": 1.1}))), {"wrong_value"}),
    "clock rate": (fast, {"clock_rate"}),
    "clipping": (clipped, {"sensor_saturation"}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_outside_the_equations_of_motion_is_named_or_plausible(fault: str) -> None:
    """The fault, or its twin, is what the verdict names or one of those that it cannot rule out; never adequate."""
    build, right = FAULTS[fault]
    model, record = build()
    verdict = diagnose(model, record, EFFECTS)
    assert verdict.verdict in ("missing_effect", "ambiguous")
    named = {named.effect for named in verdict.effects}
    plausible = {candidate.effects[0].effect for candidate in verdict.plausible if len(candidate.effects) == 1}
    assert right & (named | plausible)
    assert verdict.verdict == "ambiguous" or named <= right


def test_a_gain_is_told_from_a_scale_where_a_known_force_acts_beside_the_input() -> None:
    """Under a known weight a sensor's scale changes the sag too, a mass the frequency: the input's gain is named."""
    exact = {name: replace(parameter, fixed=True) for name, parameter in MODEL.parameters.items()}
    weighed = replace(MODEL, parameters=exact).plus("v", "-0.5")
    record = plain(weighed.plus("F", "+a*F", {"a": Parameter(0.2)}), model=weighed)
    verdict = diagnose(weighed, record, EFFECTS)
    assert [(e.effect, e.equation) for e in verdict.effects] == [("missing_input_gain", "F")]
    assert (verdict.verdict, len(verdict.plausible)) == ("missing_effect", 1)
    a = verdict.effects[0].coefficients["a"]
    assert abs(a.value - 0.2) < 4.0 * a.sd


@pytest.mark.parametrize("factor", [0.001, 0.5, 10.0])
def test_time_in_another_unit_is_a_clock_that_runs_forward(factor: float) -> None:
    """The time column in other units than the model's: the rates times 1 / factor, the damping as it was."""
    record = plain()
    library = {name: EFFECTS[name] for name in ("clock_rate", "cubic_stiffness", "sensor_bias")}
    verdict = diagnose(MODEL, replace(record, t=factor * record.t), library)
    assert [named.effect for named in verdict.effects] == ["clock_rate"]
    assert 1.0 + verdict.effects[0].coefficients["a"].value == pytest.approx(1.0 / factor, rel=0.01)
    assert verdict.parameters["c"]["value"] == pytest.approx(0.3, rel=0.05)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_sound_measurement_of_a_complete_model_shows_no_fault(seed: int) -> None:
    """Nothing wrong with sensor, input, numbers and clock: the model is adequate."""
    verdict = diagnose(MODEL, plain(seed=seed), EFFECTS)
    assert (verdict.verdict, verdict.effects) == ("adequate", ())


MISTAKES = {
    "a sensor upside down": ("two-masses-cubic", [0], None, "x2 fits with the other sign"),
    "an output of two": ("paper-cubic", [0], None, "x1 fits with the other sign"),
    "two outputs swapped": ("tank-second-outlet", [], (0, 1), "h1 and h2 fit in each other's place"),
    "an input": ("boat-drag", [1], None, "fits with the other sign"),
}


@pytest.mark.parametrize(("name", "flipped", "swapped", "said"), MISTAKES.values(), ids=MISTAKES.keys())
def test_check_names_a_mistake_with_columns(
    name: str, flipped: list[int], swapped: tuple[int, int] | None, said: str
) -> None:
    """Though the model lacks an effect as well; and of the right columns it says nothing."""
    case = plugins.cases()[name]
    record, _ = case.simulate(0.05, 1)
    columns = np.column_stack([record.y, record.u])
    m = record.y.shape[1]
    columns[:, flipped] *= -1.0
    if swapped is not None:
        columns[:, list(swapped)] = columns[:, list(swapped)[::-1]]
    mistaken = check(case.deficient, replace(record, y=columns[:, :m].copy(), u=columns[:, m:].copy())).findings
    assert any(said in finding for finding in mistaken)
    right = check(case.deficient, record).findings
    assert not any("other sign" in finding or "other's place" in finding for finding in right)
