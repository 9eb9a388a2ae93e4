"""Records that are long, plants that forget where they started, and effects that only help together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suite import plugins
from suite.case import Case
from suite.discovery import chaos, long
from suite.discovery import verdict as verdicts
from suite.discovery.fit import prepare
from suite.discovery.verdict import diagnose, investigate, judge
from suite.model import Model, Output
from suite.record import Record

EFFECTS = plugins.effects()


def lasting(name: str, duration: float) -> Case:
    """A case run for longer."""
    case = plugins.cases()[name]
    assert case.experiment is not None
    return replace(case, experiment=replace(case.experiment, duration=duration))


def test_a_long_record_of_a_hardening_spring_is_diagnosed() -> None:
    """20,000 samples at 5 % noise: cubic_stiffness is named, its coefficient within 3 sd, and that is below 1 %."""
    case = lasting("duffing", 2000.0)
    record, truth = case.simulate(0.05, 1)
    assert len(record) > 20_000
    verdict = diagnose(case.deficient, record, EFFECTS)
    assert [(e.effect, e.equation) for e in verdict.effects] == [("cubic_stiffness", "v")]
    a = verdict.effects[0].coefficients["a"]
    assert abs(a.value - 0.3) < 3.0 * a.sd < 0.03 * 0.3
    assert 0.98 < verdict.error["after"]["pos"] / truth.noise[0] < 1.02


def test_neighbours_of_a_plant_that_ignores_its_states_do_not_part() -> None:
    """The tangent is the identity: factor one from start to end, and the bound of it the root of the state count."""
    model = Model("moved by the clock alone", {"x": "cos(t)", "y": "-sin(t)"}, outputs={"x": Output("x", column="x")})
    t = np.linspace(0.0, 3.0, 31)
    record = Record(t, np.zeros((31, 0)), np.sin(t)[:, None])
    path = np.column_stack([np.sin(t), np.cos(t)])
    assert chaos._growth(model, record, path, 0, 31, exact=True) == pytest.approx(np.zeros(31), abs=1e-12)
    bound = chaos._growth(model, record, path, 0, 31, exact=False)
    assert bound[1:] == pytest.approx(np.full(30, 0.5 * np.log(2.0)), abs=1e-12)


def test_neighbours_part_as_fast_whether_followed_at_once_or_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of Lorenz-63 along its own path: what is kept of the tangents at a time changes nothing."""
    case = plugins.cases()["null-lorenz"]
    record, truth = case.simulate(0.0, 1)
    whole = chaos._growth(case.deficient, record, truth.x, 0, len(record), exact=True)
    assert whole[-1] > 1.0
    monkeypatch.setattr(chaos, "ROOM", 9 * 7)
    pieces = chaos._growth(case.deficient, record, truth.x, 0, len(record), exact=True)
    assert pieces == pytest.approx(whole, rel=1e-9)


def test_a_complete_chaotic_model_is_adequate_in_stretches() -> None:
    """Lorenz-63 over 15 s forgets its start: the record is cut into stretches, and nothing is missing."""
    case = lasting("null-lorenz", 15.0)
    found = investigate(case.deficient, case.simulate(0.01, 1)[0], EFFECTS)
    verdict, _ = judge(found)
    starts = found.problem.record.starts
    assert len(starts) > 2
    assert (verdict.verdict, verdict.effects) == ("adequate", ())
    for name, true in case.deficient.parameters.items():
        entry = verdict.parameters[name]
        assert abs(entry["value"] - true.value) < 4.0 * entry["sd"] < 0.02 * true.value


def test_two_effects_that_look_like_a_third_are_found() -> None:
    """Dry friction and drag, which viscous damping imitates better than either alone: both are named."""
    case = plugins.cases()["pendulum-friction-and-drag"]
    verdict = diagnose(case.deficient, case.simulate(0.01, 1)[0], EFFECTS)
    found = {(named.effect, named.equation): next(iter(named.coefficients.values())) for named in verdict.effects}
    true = {("coulomb_friction", "w"): 0.12, ("quadratic_drag", "w"): 0.06}
    assert set(found) == set(true)
    for name, value in true.items():
        assert abs(found[name].value - value) < 3.0 * found[name].sd


def test_the_normal_equations_of_runs_with_their_own_first_states_are_those_of_the_whole_jacobian() -> None:
    case = lasting("null-lorenz", 15.0)
    problem = prepare(case.deficient, case.simulate(0.01, 1)[0])
    layout = problem.layout(())
    passed = problem.run(problem.start, 1.0, layout)
    A, g = problem.normal(passed, len(layout.columns))
    assert len(problem.record.starts) > 2
    np.testing.assert_allclose(A, passed.J.T @ passed.J, rtol=1e-10, atol=1e-8 * np.abs(A).max())
    np.testing.assert_allclose(g, passed.J.T @ passed.e, rtol=1e-10, atol=1e-8 * np.abs(g).max())


def test_a_small_term_of_a_long_chaotic_record_is_found_though_no_exact_fit_without_it_comes_near(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Lorenz-63 with a hidden 0.01 x^3: searched in a block, then fitted to all stretches of the record."""
    monkeypatch.setattr(long, "LONG", 1400)
    monkeypatch.setattr(verdicts, "LONG", 1400)
    monkeypatch.setattr(long, "BLOCK", 700)
    case = lasting("lorenz-hidden-cubic", 40.0)
    effects = {name: EFFECTS[name] for name in ("cubic_term", "absolute_term", "quadratic_term")}
    verdict = diagnose(case.deficient, case.simulate(0.01, 0)[0], effects)
    assert [(e.effect, e.equation) for e in verdict.effects] == [("cubic_term", "x")]
    a = verdict.effects[0].coefficients["a"]
    assert abs(a.value + 0.01) < 4.0 * a.sd < 0.001
