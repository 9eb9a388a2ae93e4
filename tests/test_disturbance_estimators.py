"""The filters and smoothers with disturbance states are what their equations say, by an independent computation."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from estimators.disturbance_filter import RandomWalkFilter
from estimators.disturbance_smoother import RandomWalkSmoother
from estimators.integrated_disturbance_filter import IntegratedWalkFilter
from estimators.integrated_disturbance_smoother import IntegratedWalkSmoother
from suite.disturbance import with_integrated_walk
from suite.model import Initial, Model, Output
from suite.record import Prior, Record

A = np.array([[0.0, 1.0], [-2.0, -0.3]])  # of the oscillator
H = np.array([[1.0, 0.0], [0.5, 1.0]])


def test_the_filters_end_where_their_smoothers_end(plants: Any) -> None:
    """At the last sample filter and smoother have seen the same: x, d, P and P_d are equal to 1e-9."""
    record = plants.record(plants.PENDULUM)
    for forward, both in (
        (RandomWalkFilter(), RandomWalkSmoother()),
        (IntegratedWalkFilter(), IntegratedWalkSmoother()),
    ):
        one, two = forward.estimate(plants.PENDULUM, record), both.estimate(plants.PENDULUM, record)
        for a, b in ((one.x, two.x), (one.d, two.d), (one.P, two.P), (one.P_d, two.P_d)):
            assert a is not None
            assert b is not None
            np.testing.assert_allclose(a[-1], b[-1], rtol=0.0, atol=1e-9)
            assert np.max(np.abs(a[5] - b[5])) > 1e-6


def test_the_integrated_walk_smoother_is_batch_least_squares(plants: Any) -> None:
    """States, d and the deviation of d are those of one dense least-squares problem in all unknowns, to 1e-5."""
    record = plants.record(plants.OSCILLATOR)
    _, start = with_integrated_walk(plants.OSCILLATOR, record, plants.PRIOR, 5.0)
    found = IntegratedWalkSmoother().estimate(plants.OSCILLATOR, record, q_scale=5.0)
    # Unknown: the first [p, v, d, slope], and a kick of the slope at the start and at the end of each step.
    driven = np.zeros((4, 4))
    driven[:2, :2], driven[1, 2], driven[2, 3] = A, 1.0, 1.0
    N, kick = len(record), np.array([0.0, 0.0, 0.0, 1.0])
    path = np.zeros((N, 4, 4 + 2 * (N - 1)))
    path[0, :, :4] = np.eye(4)
    deviation = np.sqrt(np.repeat(start.Q[3] * record.dt / 2.0, 2))
    for k in range(1, N):
        before = path[k - 1].copy()
        before[:, 4 + 2 * (k - 1)] += kick
        path[k] = expm(driven * record.dt[k - 1]) @ before
        path[k, :, 5 + 2 * (k - 1)] += kick
    seen = ~np.isnan(record.y)
    rows = np.einsum("ci,kij->kcj", H, path[:, :2]) / np.sqrt(plants.PRIOR.R)[:, None]
    root = np.sqrt(np.concatenate([np.diag(start.P0), deviation**2]))
    system = np.vstack([rows[seen], np.diag(1.0 / root)])
    right = np.concatenate(
        [(record.y / np.sqrt(plants.PRIOR.R))[seen], np.concatenate([start.x0, 0.0 * deviation]) / root]
    )
    best = np.linalg.lstsq(system, right, rcond=None)[0]
    assert found.d is not None
    assert found.P_d is not None
    np.testing.assert_allclose(found.x, path[:, :2] @ best, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(found.d[:, 1], path[:, 2] @ best, rtol=0.0, atol=1e-5)
    C = np.linalg.inv(system.T @ system)
    np.testing.assert_allclose(found.P_d[:, 1, 1], np.einsum("ki,ij,kj->k", path[:, 2], C, path[:, 2]), rtol=1e-4)


def test_an_integrated_walk_follows_a_ramp_without_lag() -> None:
    """Where the model error grows steadily the integrated walk's mean error of d is below a fifth of the walk's."""
    t = np.arange(400) * 0.05
    model = Model(name="decay", states={"x": "-x"}, outputs={"z": Output("x", "z")}, initial={"x": Initial(0.0)})
    x = solve_ivp(lambda s, x: -x + 0.3 * s, (0.0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-9).y.T
    y = x + 0.02 * np.random.default_rng(0).standard_normal(x.shape)
    prior = Prior(np.zeros(1), np.zeros((1, 1)), np.array([4e-4]), np.array([0.05]))
    record = Record(t, np.zeros((400, 0)), y, prior=prior)
    lag = []
    for method in (RandomWalkFilter(), IntegratedWalkFilter()):
        d = method.estimate(model, record).d
        assert d is not None
        lag.append(abs(float(np.mean(0.3 * t[200:] - d[200:, 0]))))
    assert lag[1] < 0.2 * lag[0]
