"""filterpy's further filters and smoothers are what they say, and Savitzky-Golay is exact on cubics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from baselines import imm
from baselines._filterpy import extended
from baselines.ckf import cubature
from baselines.ekf_rts import extended_smoother
from baselines.enkf import ensemble
from baselines.h_infinity_filterpy import h_infinity
from baselines.imm import interacting
from baselines.square_root_ekf import square_root
from baselines.ukf_rts import unscented_smoother
from suite import plugins
from suite.benchmark.cells import experiment
from suite.case import Case, Experiment
from suite.disturbance import with_random_walk
from suite.filtering import filtered
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Prior, Record
from suite.smoothing import smoothed

BASELINES = plugins.find("baselines").loaded
ALONE = ("ckf", "enkf", "square-root-ekf", "h-infinity-filterpy", "imm", "ekf-rts", "ukf-rts")
NAMES = (*ALONE, *(f"{name}-disturbance" for name in ALONE))

PENDULUM = Model(
    name="driven pendulum",
    states={"angle": "rate", "rate": "F - c*rate - k*sin(angle)"},
    parameters={"c": Parameter(0.3), "k": Parameter(2.0)},
    inputs={"F": Input("F", "linear")},
    outputs={"a": Output("angle", "a", angle=True), "r": Output("rate", "r")},
    initial={"angle": Initial(0.0), "rate": Initial(0.0)},
)
LINEAR = Model(
    name="oscillator",
    states={"p": "v", "v": "F - 0.3*v - 2*p"},
    inputs={"F": Input("F", "linear")},
    outputs={"a": Output("p", "a"), "r": Output("v", "r")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
PRIOR = Prior(np.zeros(2), np.diag([0.1, 0.1]), np.array([0.01, 0.01]), np.array([0.0, 0.5]))


def swung(samples: int = 90) -> Record:
    """A pendulum with a cubic term that its model lacks, over the top; its angle is read on [-pi, pi]."""
    plant = PENDULUM.plus("rate", "-e*angle**3", {"e": Parameter(0.002)})
    inputs = {"F": lambda t: 6.0 * float(np.sin(1.5 * t))}
    record, _ = Case("p", "", PENDULUM, plant, Experiment(0.05 * (samples - 1), 0.05, (0.0, 0.0), inputs)).simulate(
        0.03, 4
    )
    angle = np.arctan2(np.sin(record.y[:, 0]), np.cos(record.y[:, 0]))
    return replace(record, y=np.column_stack([angle, record.y[:, 1]]), prior=PRIOR)


def rough(record: Record) -> Record:
    """Four samples in ten left out, a third of the readings missing, four rows among them altogether."""
    rng = np.random.default_rng(3)
    keep = np.flatnonzero(rng.random(len(record)) < 0.6)
    y = record.y[keep].copy()
    y[rng.random(y.shape) < 0.3] = np.nan
    y[:1] = y[20:23] = np.nan
    return replace(record, t=record.t[keep], u=record.u[keep], y=y)


@pytest.mark.parametrize("name", NAMES)
def test_angles_gaps_and_irregular_steps_are_ordinary(name: str) -> None:
    """Each filter follows a pendulum over the top from rough readings, with sound covariances, twice the same."""
    record = rough(swung())
    before = record.y.copy()
    method = BASELINES[name]
    found = method.estimate(PENDULUM, record)
    np.testing.assert_array_equal(before, record.y)
    assert (found.status, found.note) == ("ok", "")
    assert found.P is not None
    assert found.d is not None
    assert np.linalg.eigvalsh(found.P).min() > -1e-9
    assert_allclose(found.P, found.P.transpose(0, 2, 1), atol=1e-10)
    assert np.all(found.d[:, 0] == 0.0) or not name.endswith("disturbance")
    wrapped = np.arctan2(np.sin(record.y - found.x), np.cos(record.y - found.x))[:, 0]
    assert np.nanstd(wrapped) < 0.35
    again = method.estimate(PENDULUM, record)
    np.testing.assert_array_equal(found.x, again.x)
    np.testing.assert_array_equal(found.d, again.d)


@pytest.mark.parametrize("first", [0.1, 0.0], ids=["unsure", "known"])
def test_on_a_linear_plant_they_are_the_exact_filter_and_smoother(first: float) -> None:
    """To 1e-9 of the compiled Kalman filter and smoother, from rough readings, also where the first state is known."""
    prior = replace(PRIOR, P0=first * np.eye(2))
    record = rough(swung()).with_prior(prior)
    run = filtered(LINEAR, record, prior.x0, prior.P0, prior.Q, prior.R)
    exact = smoothed(run)
    for kind, wanted in (
        (cubature, run),
        (square_root, run),
        (lambda m, r, p: h_infinity(m, r, p, theta=0.0), run),
        (extended_smoother, exact),
        (unscented_smoother, exact),
    ):
        found = kind(LINEAR, record, prior)
        assert_allclose(found.x, wanted.x, rtol=0, atol=1e-9)
        assert_allclose(found.P, wanted.P, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["ekf-rts-disturbance", "ukf-rts-disturbance"])
def test_a_smoothed_disturbance_is_the_exact_smoothers(name: str) -> None:
    """States, d and its covariance are those of the compiled smoother of the model with a random walk, to 1e-8."""
    record = rough(swung())
    grown, start = with_random_walk(LINEAR, record, PRIOR, 1.0)
    exact = smoothed(filtered(grown, record, start.x0, start.P0, start.Q, start.R))
    found = BASELINES[name].estimate(LINEAR, record)
    assert found.d is not None
    assert found.P_d is not None
    assert_allclose(found.x, exact.x[:, :2], rtol=0, atol=1e-8)
    assert_allclose(found.d[:, 1], exact.x[:, 2], rtol=0, atol=1e-8)
    assert_allclose(found.P_d[:, 1, 1], exact.P[:, 2, 2], rtol=0, atol=1e-8)


def test_an_ensemble_comes_nearer_to_the_exact_filter_as_it_grows() -> None:
    """Its distance from the Kalman filter, in standard deviations, falls about with the root of its size."""
    inputs = {"F": lambda t: float(np.sin(1.5 * t))}
    record, _ = Case("o", "", LINEAR, LINEAR, Experiment(2.0, 0.05, (0.0, 0.0), inputs)).simulate(0.1, 4)
    run = filtered(LINEAR, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    sd = np.sqrt(np.einsum("kii->ki", run.P))
    far = [np.sqrt(np.mean(((ensemble(LINEAR, record, PRIOR, N).x - run.x) / sd) ** 2)) for N in (10, 160)]
    assert far[1] < 3.0 / np.sqrt(160)
    assert 2.0 < far[0] / far[1] < 16.0


def test_the_ensemble_leaves_numpys_generator_alone() -> None:
    """The global generator goes on as if nothing had been drawn, and other readings give another ensemble."""
    record = swung(12)
    np.random.seed(5)
    wanted = np.random.standard_normal(3)
    np.random.seed(5)
    one = ensemble(LINEAR, record, PRIOR)
    np.testing.assert_array_equal(np.random.standard_normal(3), wanted)
    other = ensemble(LINEAR, replace(record, y=record.y + 1e-9), PRIOR)
    assert np.abs(one.x - other.x).max() > 1e-4


def test_two_equal_models_are_one_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Interacting models with the same noise are the extended filter, also where nothing or a part is measured."""
    monkeypatch.setattr(imm, "SHARES", (1.0, 1.0))
    record = rough(swung())
    one, both = extended(PENDULUM, record, PRIOR), interacting(PENDULUM, record, PRIOR)
    assert_allclose(both.x, one.x, rtol=0, atol=1e-9)
    assert_allclose(both.P, one.P, rtol=0, atol=1e-9)
    assert both.mean_nis == pytest.approx(one.mean_nis, rel=1e-9)


def test_interacting_models_believe_a_model_that_holds() -> None:
    """Where nothing is missing they end nearer to the truth than the filter that always doubts, over six seeds."""
    case = plugins.cases()["null-oscillator"]
    errors = {"ekf": 0.0, "imm": 0.0}
    for seed in range(6):
        record, truth = experiment(case, 0.05, seed, None)
        assert truth is not None
        for name in errors:
            found = BASELINES[name].estimate(case.deficient, record.part(0, 90))
            errors[name] += float(np.mean((found.x - truth.x[:90]) ** 2))
    assert errors["imm"] < 0.8 * errors["ekf"]


def test_a_robust_filter_is_more_careful_until_there_is_none() -> None:
    """Its P grows with theta; at a theta that is too large the note says that no such filter exists and from when."""
    record = swung()
    spread = [np.trace(h_infinity(LINEAR, record, PRIOR, theta).P[-1]) for theta in (0.0, 0.01, 0.05)]
    assert spread[0] < spread[1] < spread[2]
    found = BASELINES["h-infinity-filterpy"].estimate(LINEAR, record, theta=0.9)
    assert found.status == "diverged"
    assert "no H-infinity filter with theta = 0.9 exists at t = " in found.note
    assert np.all(np.isfinite(found.x))


@pytest.mark.parametrize("name", NAMES)
def test_a_run_that_explodes_is_a_status(name: str) -> None:
    """On x' = x^3 without readings the arrays stay finite and the status says what happened."""
    model = Model("explosion", {"x": "x**3"}, outputs={"z": Output("x", "z")}, initial={"x": Initial(0.0)})
    y = np.full((40, 1), np.nan)
    y[0] = 5.0
    prior = Prior(np.array([5.0]), np.eye(1), np.array([1e-2]), np.array([1.0]))
    found = BASELINES[name].estimate(model, Record(np.arange(40) * 0.5, np.zeros((40, 0)), y, prior=prior))
    assert found.status == "diverged"
    assert len(found.note) > 20
    for values in (found.x, found.P, found.d):
        assert values is not None
        assert np.all(np.isfinite(values))


@pytest.mark.parametrize("name", sorted({*NAMES, "savitzky-golay"} - {"enkf", "enkf-disturbance"}))
def test_other_units_give_the_same_answer(name: str) -> None:
    """With the position in thousandths, and data and prior with it, the estimates scale (not an ensemble's draws)."""
    small = replace(LINEAR, states={"p": "1000*v", "v": "F - 0.3*v - 0.002*p"})
    record = swung(60)
    scale = np.array([1e3, 1.0])
    prior = Prior(PRIOR.x0, PRIOR.P0 * np.outer(scale, scale), PRIOR.R * scale**2, PRIOR.Q * scale**2)
    small = replace(small, suspect=("v",))
    one = BASELINES[name].estimate(LINEAR, record)
    other = BASELINES[name].estimate(small, replace(record, y=record.y * scale, prior=prior))
    assert one.d is not None
    assert other.d is not None
    assert_allclose(other.x / scale, one.x, rtol=1e-6, atol=1e-7)
    assert_allclose(other.d / scale, one.d, rtol=1e-6, atol=1e-6)


def test_savitzky_golay_is_exact_on_cubics() -> None:
    """Of a cubic motion its velocity and the missing force are exact to rounding, from readings of 2 p + 1."""
    model = Model("mass", {"p": "v", "v": "0"}, outputs={"z": Output("2*p + 1", "z")}, initial={})
    t = np.arange(60) * 0.1
    p, v, a = t**3 - 2 * t, 3 * t**2 - 2, 6 * t
    record = Record(t, np.zeros((60, 0)), 2 * p[:, None] + 1, prior=PRIOR)
    found = BASELINES["savitzky-golay"].estimate(model, record)
    assert found.d is not None
    assert_allclose(found.x, np.column_stack([p, v]), atol=1e-8)
    assert_allclose(found.d, np.column_stack([0 * a, a]), atol=1e-7)


def test_savitzky_golay_finds_the_coefficient() -> None:
    """Noise of 1 % on both states: the cubic coefficient 0.0195 within 4 %, with a tenth of the readings gone 8 %."""
    case = plugins.cases()["paper-cubic"]
    for seed in range(5):
        record, _ = experiment(case, 0.01, seed, None)
        gone = np.random.default_rng(seed).random(record.y.shape) < 0.1
        for given, within in ((record, 0.04), (replace(record, y=np.where(gone, np.nan, record.y)), 0.08)):
            found = BASELINES["savitzky-golay"].estimate(case.deficient, given)
            assert found.d is not None
            cube = -(found.x[:, 1] ** 3)
            assert cube @ found.d[:, 0] / (cube @ cube) == pytest.approx(0.0195, rel=within)


def test_savitzky_golay_says_where_it_does_not_apply() -> None:
    """A state that no output reads, and readings too far apart, are reasons to abstain."""
    method, record = BASELINES["savitzky-golay"], swung()
    hidden = replace(LINEAR, outputs={"r": LINEAR.outputs["r"], "s": Output("v + p", "s")})
    assert method.skip(LINEAR, record) is None
    assert method.skip(hidden, record) == "p is neither measured nor the rate of a measured state"
    y = record.y.copy()
    y[np.arange(len(y)) % 3 > 0, 0] = np.nan
    assert "of a more than half the readings are missing" in (method.skip(LINEAR, replace(record, y=y)) or "")
