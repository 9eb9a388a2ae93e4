"""Every estimator and baseline keeps the contract, and on a linear plant they agree with the exact filter."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from baselines._filterpy import extended, unscented
from suite import plugins
from suite.case import Case, Experiment
from suite.errors import DataError
from suite.estimator import Estimate, Estimator
from suite.filtering import filtered
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Prior, Record

METHODS = plugins.estimators()
NAMES = {
    "generalized-ie", "generalized-ie-discrete", "conventional-ie", "conventional-ie-discrete", "sra", "sra-discrete",
    "minimum-model-error", "random-walk-smoother", "ekf", "ukf", "ekf-disturbance", "ukf-disturbance",
}  # fmt: skip

TRUE = Model(
    name="driven pendulum",
    states={"angle": "rate", "rate": "F - c*rate - k*sin(angle) - e*angle**3"},
    parameters={"c": Parameter(0.3), "k": Parameter(2.0), "e": Parameter(0.4)},
    inputs={"F": Input("F", "linear")},
    outputs={"a": Output("angle", "a", angle=True), "r": Output("rate", "r")},
    initial={"angle": Initial(0.0), "rate": Initial(0.0)},
)
DEFICIENT = TRUE.with_values({"e": 0.0})
PRIOR = Prior(np.zeros(2), np.diag([0.1, 0.1]), np.array([0.01, 0.01]), np.array([0.0, 0.5]))


def simulated(model: Model = TRUE, amplitude: float = 2.0) -> Record:
    """Six seconds of the pendulum, which swings over the top at a large amplitude."""
    inputs = {"F": lambda t: amplitude * float(np.sin(1.5 * t))}
    record, _ = Case("pendulum", "", DEFICIENT, model, Experiment(6.0, 0.05, (0.0, 0.0), inputs)).simulate(0.05, 4)
    return record.with_prior(PRIOR)


def with_gaps(record: Record) -> Record:
    """A third of all readings missing, and three samples in a row altogether, the first among them."""
    y = record.y.copy()
    y[np.random.default_rng(2).random(y.shape) < 0.3] = np.nan
    y[:1] = y[40:43] = np.nan
    return Record(record.t, record.u, y, prior=record.prior)


def irregular(record: Record) -> Record:
    """Four samples in ten left out at random."""
    keep = np.flatnonzero(np.random.default_rng(3).random(len(record)) < 0.6)
    return Record(record.t[keep], record.u[keep], record.y[keep], prior=record.prior)


def check(found: Estimate, N: int, n: int = 2) -> None:
    """Shapes, finite numbers, symmetric covariances, and a sentence where something went wrong."""
    assert found.x.shape == (N, n)
    assert np.all(np.isfinite(found.x))
    for P in (found.P, found.P_d):
        if P is not None:
            assert P.shape == (N, n, n)
            assert np.all(np.isfinite(P))
            np.testing.assert_allclose(P, P.transpose(0, 2, 1), rtol=1e-9, atol=1e-12)
    assert found.d is not None
    assert found.d.shape == (N, n)
    assert np.all(np.isfinite(found.d))
    assert found.status == "ok" or len(found.note) > 20
    assert found.J is None or np.all(np.isfinite(found.J))


def test_the_matrix_is_complete() -> None:
    """All methods are found by their file's place, and none failed to load."""
    assert set(METHODS) >= NAMES
    assert not plugins.find("estimators").failed
    assert not plugins.find("baselines").failed


@pytest.mark.parametrize("name", sorted(NAMES))
@pytest.mark.parametrize("change", [lambda record: record, with_gaps, irregular], ids=["plain", "gaps", "irregular"])
def test_an_estimate_has_the_contracts_shapes(name: str, change) -> None:
    """Also with readings missing and irregular steps; a filter with a positive source ends well."""
    record = change(simulated())
    found = METHODS[name].estimate(DEFICIENT, record)
    check(found, len(record))
    if not name.startswith("sra"):
        assert found.status == "ok"
        assert found.P is None or np.linalg.eigvalsh(found.P).min() > -1e-9


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_call_changes_nothing_and_repeats(name: str) -> None:
    """Record and prior are as before the call, and a second call gives the same numbers."""
    record = simulated()
    before = [a.copy() for a in (record.t, record.u, record.y, PRIOR.x0, PRIOR.P0, PRIOR.R, PRIOR.Q)]
    one = METHODS[name].estimate(DEFICIENT, record)
    after = [record.t, record.u, record.y, PRIOR.x0, PRIOR.P0, PRIOR.R, PRIOR.Q]
    for a, b in zip(before, after, strict=True):
        np.testing.assert_array_equal(a, b)
    other = METHODS[name].estimate(DEFICIENT, record)
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.d, other.d)
    assert one.J == other.J
    assert one.note == other.note


@pytest.mark.parametrize("name", sorted(NAMES))
def test_tuning_moves_arguments_that_exist(name: str) -> None:
    """Each tuned name is an argument of estimate, and both ends of its range give finite numbers."""
    method: Estimator = METHODS[name]
    assert method.tuning
    record = simulated().part(0, 40)
    for key, (low, high, _) in method.tuning.items():
        assert key in inspect.signature(method.estimate).parameters
        assert low < high
        for value in (low, high):
            check(method.estimate(DEFICIENT, record, **{key: value}), len(record))


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_diverging_run_says_so(name: str) -> None:
    """On a plant that explodes the arrays stay finite, and where the filter is lost status and note say so."""
    model = Model(
        name="explosion",
        states={"x": "x**3"},
        outputs={"z": Output("x", "z")},
        initial={"x": Initial(0.0)},
        suspect=("x",),
    )
    t = np.arange(40) * 0.5
    y = np.full((40, 1), np.nan)
    y[0] = 5.0
    prior = Prior(np.array([5.0]), np.eye(1), np.array([1e-2]), np.array([1.0]))
    found = METHODS[name].estimate(model, Record(t, np.zeros((40, 0)), y, prior=prior))
    check(found, 40, 1)
    assert found.status == "diverged"


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_record_without_prior_is_refused_with_the_mend(name: str) -> None:
    """The error names what is missing and how to add it."""
    record = simulated()
    bare = Record(record.t, record.u, record.y)
    with pytest.raises(DataError, match="with_prior"):
        METHODS[name].estimate(DEFICIENT, bare)


@pytest.mark.parametrize("change", [lambda record: record, with_gaps, irregular], ids=["plain", "gaps", "irregular"])
def test_the_kernels_filter_is_filterpys(change) -> None:
    """The compiled EKF gives filterpy's states and covariances to 1e-9, also where angles wrap and readings miss."""
    record = change(simulated(amplitude=8.0))
    wrapped = np.arctan2(np.sin(record.y[:, 0]), np.cos(record.y[:, 0]))
    record = Record(record.t, record.u, np.column_stack([wrapped, record.y[:, 1]]), prior=PRIOR)
    ours = filtered(DEFICIENT, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    theirs = extended(DEFICIENT, record, PRIOR)
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(ours.P, theirs.P, rtol=0.0, atol=1e-9)


def test_on_a_linear_plant_the_filters_agree() -> None:
    """Compiled EKF, filterpy's EKF and UKF, and discrete embedding are the Kalman filter there, to 1e-9."""
    linear = Model(
        name="oscillator",
        states={"p": "v", "v": "F - 0.3*v - 2*p"},
        inputs={"F": Input("F", "linear")},
        outputs={"a": Output("p", "a"), "r": Output("v", "r")},
        initial={"p": Initial(0.0), "v": Initial(0.0)},
    )
    record = with_gaps(simulated())
    run = filtered(linear, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    for name in ("ekf", "ukf", "conventional-ie-discrete", "generalized-ie-discrete"):
        found = METHODS[name].estimate(linear, record)
        np.testing.assert_allclose(found.x, run.x, rtol=0.0, atol=1e-9, err_msg=name)
        np.testing.assert_allclose(found.P, run.P, rtol=0.0, atol=1e-9, err_msg=name)
    assert unscented(linear, record, PRIOR).mean_nis == pytest.approx(
        extended(linear, record, PRIOR).mean_nis, rel=1e-9
    )


@pytest.mark.parametrize("name", sorted(NAMES - {"sra", "sra-discrete"}))
def test_other_units_give_the_same_answer(name: str) -> None:
    """With the states in thousandths of their unit, and the data and prior with them, the estimates scale to 1e-6."""
    metres = Model(
        name="oscillator in metres",
        states={"p": "v", "v": "F - 0.3*v - 2*p"},
        inputs={"F": Input("F", "linear")},
        outputs={"a": Output("p", "a")},
        initial={"p": Initial(0.0), "v": Initial(0.0)},
    )
    millimetres = Model(
        name="oscillator in millimetres",
        states={"p": "v", "v": "1000*F - 0.3*v - 2*p"},
        inputs={"F": Input("F", "linear")},
        outputs={"a": Output("p", "a")},
        initial={"p": Initial(0.0), "v": Initial(0.0)},
    )
    full = simulated()
    prior = Prior(PRIOR.x0, PRIOR.P0, PRIOR.R[:1], PRIOR.Q)
    record = Record(full.t, full.u, full.y[:, :1], prior=prior)
    scaled = Prior(1e3 * prior.x0, 1e6 * prior.P0, 1e6 * prior.R, 1e6 * prior.Q)
    one = METHODS[name].estimate(metres, record)
    other = METHODS[name].estimate(millimetres, Record(full.t, full.u, 1e3 * full.y[:, :1], prior=scaled))
    assert one.d is not None
    assert other.d is not None
    np.testing.assert_allclose(other.x / 1e3, one.x, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(other.d / 1e3, one.d, rtol=1e-6, atol=1e-7)
    if one.J is not None:
        assert pytest.approx(one.J, rel=1e-6) == other.J


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_model_without_suspects_has_no_model_error_of_its_own(name: str) -> None:
    """Where no equation may be wrong every method still runs, and the disturbance estimators say d = 0."""
    model = Model(
        name="decay", states={"x": "-x"}, outputs={"z": Output("x", "z")}, initial={"x": Initial(1.0)}, suspect=()
    )
    t = np.arange(30) * 0.1
    y = np.exp(-t)[:, None] + 0.01 * np.random.default_rng(0).standard_normal((30, 1))
    prior = Prior(np.ones(1), np.zeros((1, 1)), np.array([1e-4]), np.zeros(1))
    found = METHODS[name].estimate(model, Record(t, np.zeros((30, 0)), y, prior=prior))
    check(found, 30, 1)
    assert found.status == "ok"
    assert found.d is not None
    assert np.all(found.d == 0.0)
