"""Each contract check finds the defect that it is for: sound plug-ins with one fault put in fail it."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from baselines.ekf import EKF
from suite import contract, plugins, scaffold
from suite.contracts import gaussian, optimality, plants
from suite.contracts.outcome import BrokenContractError
from suite.filtering import filtered
from suite.smoothing import smoothed


def outcome(kind: str, check: str, *changes: tuple[str, str]) -> tuple[str, str]:
    """How a check ends on the plug-in that `unmodelled new` writes, with its text changed."""
    text = scaffold._filled(f"{kind}.py.txt", "my_own" if kind == "effect" else "my-own", kind)
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    module = ModuleType("my_own")
    exec(text, module.__dict__)
    found = plugins.Found()
    plugins.take(found, "file", "my_own", lambda: module)
    assert found.failed == {}
    (plug_in,) = found.loaded.values()
    one: dict[str, Any] = {check: contract.checks(plug_in)[check]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contract, "checks", lambda _: one)
        (line,) = contract.tested(kind, "my-own", plug_in)
    return line.outcome, line.reason


ESTIMATORS = {
    "no docstring": ("docstring and kind", ('"""Extended', 'pass\n    """Extended'), "no docstring"),
    "a list for x": ("shapes and finite values", ("Estimate(x=xs, P=Ps", "Estimate(x=xs.tolist(), P=Ps"), "x is list"),
    "d of the wrong shape": ("shapes and finite values", ("d=d)  #", "d=d[:, :1])  #"), "d has shape (121, 1)"),
    "no note": ("two and three samples", ("return Estimate(x=xs, P", 'return Estimate(status="lost", x=xs, P'), "note"),
    "works in the record": ("inputs unchanged", ("e = (rec", "record.y[k] *= 2.0\n            e = (rec"), "changed y"),
    "works in the prior": (
        "inputs unchanged",
        ("prior.x0.copy()", "np.add(prior.x0, 1.0, out=prior.x0)"),
        "changed x0",
    ),
    "chance": ("same result twice", ("xs[k], Ps[k] = x,", "xs[k], Ps[k] = x + np.random.randn(n),"), "x differs"),
    "no gaps": ("missing samples", ("seen = ~np.isnan(record.y[k])", "seen = np.full(len(record.y[k]), True)"), ""),
    "whole samples": (
        "gaps by channel",
        ("seen = ~np.isnan(record.y[k])", "seen = [~np.isnan(record.y[k, 0])] * 2"),
        "",
    ),
    "two states": ("one state", ("x, P = prior.x0.copy()", "x, P = np.zeros(2) + prior.x0"), ""),
    "without the first": ("two and three samples", ("N, n = len(record)", "N, n = record.t[3:].size"), ""),
    "no words": (
        "refusal with a reason",
        ("    def estimate", "    def skip(self, m, r): return True\n    def estimate"),
        "",
    ),
    "an unknown keyword": ("tuning", ('{"q_scale":', '{"r_scale":'), "no keyword of estimate"),
    "an empty range": ("tuning", ('(1e-4, 1e4, "log")', '(0.0, 1e4, "log")'), "no log range"),
    "d by step": ("d in rate units", ("K @ e / dt", "K @ e"), "not in rate units"),
    "skew": ("covariance", ("xs[k], Ps[k] = x, P", "xs[k], Ps[k] = x, P + [[0.0, 0.1], [0.0, 0.0]]"), "not symmetric"),
    "negative": ("covariance", ("xs[k], Ps[k] = x, P", "xs[k], Ps[k] = x, -P"), "eigenvalue"),
    "a gain too low": ("linear-Gaussian agreement", ("x + K @ e", "x + 0.9 * K @ e"), "standard deviations"),
    "one step for all": ("linear-Gaussian agreement", ("Q * dt)", "Q * record.dt[0])"), "standard deviations"),
    "the wrong claim": ("linear-Gaussian agreement", ('= "white noise"', '= "random walk"'), "standard deviations"),
    "no such claim": ("linear-Gaussian agreement", ('= "white noise"', '= "all noise"'), "expected one of"),
    "too sure": ("covariance calibrated", ("xs[k], Ps[k] = x, P", "xs[k], Ps[k] = x, 0.5 * P"), "NEES"),
    "too unsure": ("covariance calibrated", ("xs[k], Ps[k] = x, P", "xs[k], Ps[k] = x, 2.0 * P"), "NEES"),
}


@pytest.mark.parametrize("fault", ESTIMATORS)
def test_a_fault_in_an_estimator_is_found(fault: str) -> None:
    """The extended Kalman filter with one line changed fails the check that is about that line."""
    check, change, reason = ESTIMATORS[fault]
    found = outcome("estimator", check, change)
    assert found[0] == "failed", found
    assert reason in found[1]


CASES = {
    "another coefficient": ("missing effects", ('"v", {"a": 0.4})', '"v", {"a": 0.5})'), "the truth has 0.4"),
    "no such effect": ("missing effects", ('"quadratic_drag"', '"quadratic_dragg"'), "no effect"),
    "another effect": ("shape of the model error", ('"quadratic_drag"', '"cubic_stiffness"'), "cosine"),
    "another equation": ("model error", ('_drag", "v"', '_drag", "p"'), "missing says otherwise"),
    "other units": ("units", ('unit="N/m"', 'unit="N m"'), ""),
    "nothing said": ("null", ('    missing=(Missing("quadratic_drag", "v", {"a": 0.4}),),\n', ""), 'tag it "null"'),
    "runs away": ("simulates or reads", ('"-a*v*abs(v)"', '"+a*v**3"'), ""),
    "no sentence": ("sentence", ("lacks the drag.", "lacks the drag"), "does not end"),
}


@pytest.mark.parametrize("fault", CASES)
def test_a_fault_in_a_case_is_found(fault: str) -> None:
    """A case that says something else than its truth fails."""
    check, change, reason = CASES[fault]
    found = outcome("case", check, change)
    assert found[0] == "failed", found
    assert reason in found[1]


EFFECTS = {
    "no sign": ("words", ('term="-a', 'term="a'), "does not open with its sign"),
    "no role": ("words", ('"rate"}', '"pace"}'), "the role 'pace'"),
    "no width": ("sign and ranges", ('"spread", 0.3,', '"spread", 0.003,'), "outside its range"),
    "never": ("candidates", ('"v": "rate"', '"v": "rate", "T": "temperature"'), "no plant plays its roles"),
    "always there": ("gone at zero", ("-a*p/(1", "-(a + 0.5)*p/(1"), "with coefficient zero"),
    "no effect": ("gone at zero", ("-a*p/(1", "-a*0*p/(1"), "no output moves"),
    "a jump": ("slopes", ("-a*p/(1 + (p/w)**2)**2", "-a*p*sign(sin(1e5*p/w))"), "slope"),
    "unreadable": ("picture", ("-a*p/(1", "-a*p/(2 +* 1"), ""),
}


@pytest.mark.parametrize("fault", EFFECTS)
def test_a_fault_in_an_effect_is_found(fault: str) -> None:
    """A magnet with one fault fails the check that is about it."""
    check, change, reason = EFFECTS[fault]
    found = outcome("effect", check, change)
    assert found[0] == "failed", found
    assert reason in found[1]


@pytest.mark.parametrize("name", ["ekf", "minimum-model-error", "random-walk-smoother", "ekf-disturbance"])
def test_a_claim_of_the_package_holds(name: str) -> None:
    """These state what they are optimal for, and are it to 1e-3 posterior standard deviations, with P calibrated."""
    method = plugins.estimators()[name]
    assert method.optimal is not None
    optimality.linear_gaussian(method)
    optimality.calibrated(method)


def test_conditioning_is_kalmans_filter_and_the_smoother() -> None:
    """The dense conditional distribution is what the compiled filter and smoother give, to 1e-4 of its sd."""
    record = optimality._experiment(plants.LINEAR)
    prior = plants.gaussian_prior(plants.LINEAR)
    path = gaussian.path(plants.LINEAR, record, prior, "at the end")
    measured, _ = optimality._measured(path, prior, record, 3)
    run = filtered(plants.LINEAR, measured, prior.x0, prior.P0, prior.Q, prior.R)
    for causal, x, P in ((True, run.x, run.P), (False, smoothed(run).x, smoothed(run).P)):
        exact, covariance = path.given(measured.y, prior.R, causal=causal)
        sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        assert np.max(np.abs(x - exact) / sd) < 1e-4
        assert np.max(np.abs(P - covariance) / (sd[:, :, None] * sd[:, None, :])) < 1e-4


def test_a_method_that_raises_is_a_failed_line() -> None:
    """Whatever a plug-in does, the check ends in a sentence, and the others still run."""
    lines = list(contract.tested("x", "x", plugins.cases()["duffing"]))
    assert {line.outcome for line in lines} <= {"passed", "not applicable"}
    with pytest.raises(BrokenContractError, match="not an Estimate"):
        optimality.estimated(_Wrong(), plants.DECAY, plants.record(plants.DECAY, plants.FASTER))


class _Wrong(EKF):
    """Returns numbers instead of an Estimate."""

    def estimate(self, model: Any, record: Any, q_scale: float = 1.0) -> Any:
        return np.zeros(3)
