"""The further estimators keep the contract with gaps and uneven steps, in any unit, and tell when they are lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from estimators.disturbance_filter import RandomWalkFilter
from estimators.h_infinity import CentralHInfinity
from estimators.integrated_disturbance_filter import IntegratedWalkFilter
from estimators.integrated_disturbance_smoother import IntegratedWalkSmoother
from estimators.moving_horizon import MovingHorizon
from estimators.predictive_filter import PredictiveFilter
from suite import plugins
from suite.errors import DataError
from suite.estimator import Estimator
from suite.model import Model, Output
from suite.record import Prior, Record

QUICK: list[Estimator] = [
    RandomWalkFilter(), IntegratedWalkFilter(), IntegratedWalkSmoother(), PredictiveFilter(), CentralHInfinity(),
]  # fmt: skip
METHODS: list[Estimator] = [*QUICK, MovingHorizon()]


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_the_contract_holds_with_gaps_and_uneven_steps(method: Estimator, plants: Any) -> None:
    """Shapes, finite numbers, symmetric covariances, unchanged inputs, the same numbers twice, a d that is there."""
    if method.name == "moving-horizon":
        pytest.importorskip("casadi")
    assert plugins.estimators()[method.name].name == method.name
    record = plants.record(plants.PENDULUM)
    before = [
        a.copy()
        for a in (record.t, record.u, record.y, plants.PRIOR.x0, plants.PRIOR.P0, plants.PRIOR.R, plants.PRIOR.Q)
    ]
    found, again = method.estimate(plants.PENDULUM, record), method.estimate(plants.PENDULUM, record)
    for a, b in zip(
        before,
        (record.t, record.u, record.y, plants.PRIOR.x0, plants.PRIOR.P0, plants.PRIOR.R, plants.PRIOR.Q),
        strict=True,
    ):
        np.testing.assert_array_equal(a, b)
    assert found.status == "ok", found.note
    assert found.d is not None
    assert again.d is not None
    for one, two in ((found.x, again.x), (found.d, again.d)):
        assert one.shape == (len(record), 2)
        assert np.all(np.isfinite(one))
        np.testing.assert_array_equal(one, two)
    assert np.ptp(found.d[:, 1]) > 0.0
    for P in (found.P, found.P_d):
        if P is not None:
            np.testing.assert_allclose(P, P.transpose(0, 2, 1), rtol=1e-9, atol=1e-12)
            assert np.linalg.eigvalsh(P).min() > -1e-9
    with pytest.raises(DataError, match="with_prior"):
        method.estimate(plants.PENDULUM, Record(record.t, record.u, record.y))


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_plant_that_explodes_is_told(method: Estimator) -> None:
    """Arrays stay finite and status and note say when the estimate was lost."""
    if method.name == "moving-horizon":
        pytest.importorskip("casadi")
    model = Model(name="explosion", states={"x": "x**3"}, outputs={"z": Output("x", "z")}, suspect=("x",))
    y = np.full((20, 1), np.nan)
    y[0] = 5.0
    prior = Prior(np.array([5.0]), np.eye(1), np.array([1e-2]), np.array([1.0]))
    found = method.estimate(model, Record(np.arange(20) * 0.5, np.zeros((20, 0)), y, prior=prior))
    assert found.status == "diverged"
    assert "t = " in found.note
    assert found.d is not None
    assert np.all(np.isfinite(found.x))
    assert np.all(np.isfinite(found.d))


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_model_without_suspects_and_another_unit(method: Estimator, plants: Any) -> None:
    """Without suspects d is zero; with states and data in thousandths the answer is the same."""
    if method.name == "moving-horizon":
        pytest.importorskip("casadi")
    sound = Model(name="decay", states={"x": "-x"}, outputs={"z": Output("x", "z")}, suspect=())
    t, none = np.arange(15) * 0.1, np.zeros((15, 0))
    prior = Prior(np.ones(1), np.zeros((1, 1)), np.array([1e-4]), np.zeros(1))
    found = method.estimate(sound, Record(t, none, np.exp(-t)[:, None] + 0.01 * np.sin(9.0 * t)[:, None], prior=prior))
    assert found.status == "ok"
    assert found.d is not None
    assert np.all(found.d == 0.0)
    record = plants.record(plants.OSCILLATOR)
    scaled = Prior(1e3 * plants.PRIOR.x0, 1e6 * plants.PRIOR.P0, 1e6 * plants.PRIOR.R, 1e6 * plants.PRIOR.Q)
    one = method.estimate(plants.OSCILLATOR, record)
    other = method.estimate(plants.OSCILLATOR, Record(record.t, record.u, 1e3 * record.y, prior=scaled))
    assert one.d is not None
    assert other.d is not None
    np.testing.assert_allclose(other.x / 1e3, one.x, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(other.d / 1e3, one.d, rtol=1e-5, atol=1e-5)
