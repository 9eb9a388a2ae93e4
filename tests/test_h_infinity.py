"""The central H-infinity filter keeps its bound, and is the Kalman filter where there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from estimators.h_infinity import CentralHInfinity
from suite.filtering import filtered
from suite.model import Model
from suite.record import Prior, Record

H = np.array([[1.0, 0.0], [0.5, 1.0]])  # of the oscillator


def central(model: Model, record: Record, gamma: float, L: np.ndarray) -> tuple[np.ndarray | None, float]:
    """Estimates of the central filter with matrices inverted as written, None where the condition fails; and the
    largest ratio of the error's energy to the disturbances' over all x0, w, v: a singular value of the whole map.
    """
    prior, N = record.prior, len(record)
    assert prior is not None
    x, P, error, xs, rows = prior.x0, prior.P0, np.zeros((2, 2 + 4 * N)), [], []
    error[:, :2] = np.linalg.cholesky(prior.P0)
    for k in range(N):
        if k > 0:
            dt = record.dt[k - 1]
            F = model.transition(record.t[k - 1], x, (), dt)[1]
            x, error = F @ x, F @ error
            error[:, 2 + 2 * k : 4 + 2 * k] += np.diag(np.sqrt(prior.Q * dt))
            P = F @ P @ F.T + np.diag(prior.Q * dt)
        information = np.linalg.inv(P) + H.T @ np.diag(1.0 / prior.R) @ H
        K = np.linalg.solve(information, H.T / prior.R)
        x, error = x + K @ (record.y[k] - H @ x), (np.eye(2) - K @ H) @ error
        error[:, 2 + 2 * N + 2 * k : 4 + 2 * N + 2 * k] -= K * np.sqrt(prior.R)
        xs.append(x)
        rows.append(L @ error)
        rest = information - L.T @ L / gamma**2
        if np.linalg.eigvalsh(rest)[0] <= 0.0:
            return None, np.inf
        P = np.linalg.inv(rest)
    return np.array(xs), float(np.linalg.norm(np.vstack(rows), 2))


def test_the_central_filter_keeps_its_bound(plants: Any) -> None:
    """It equals the textbook recursion; its worst ratio of energies is below gamma; below the least gamma there is no
    filter, and the Kalman filter's worst ratio is not below the least gamma.
    """
    full = Prior(plants.PRIOR.x0, plants.PRIOR.P0, plants.PRIOR.R, np.array([0.1, 0.4]))
    record = Record(*(getattr(plants.record(plants.OSCILLATOR, gaps=False), name) for name in "tuy"), prior=full)
    L = np.array([[1.0, 0.3], [0.0, 2.0]])
    free = CentralHInfinity().estimate(plants.OSCILLATOR, record, L=L)
    assert free.report is not None
    least = float(free.report["least gamma"])
    assert free.report["gamma"] == pytest.approx(1.5 * least)
    for gamma in (1.005 * least, 1.5 * least, 20.0 * least):
        found = CentralHInfinity().estimate(plants.OSCILLATOR, record, gamma=gamma, L=L)
        expected, worst = central(plants.OSCILLATOR, record, gamma, L)
        assert found.status == "ok"
        assert expected is not None
        np.testing.assert_allclose(found.x, expected, rtol=0.0, atol=1e-8)
        assert worst < gamma
    assert central(plants.OSCILLATOR, record, 1e9, L)[1] > least * (1.0 - 2e-3)
    below = CentralHInfinity().estimate(plants.OSCILLATOR, record, gamma=0.99 * least, L=L)
    assert central(plants.OSCILLATOR, record, 0.99 * least, L)[0] is None
    assert below.status == "no filter"
    assert "first fails at t = " in below.note
    assert np.all(np.isfinite(below.x))


def test_without_a_bound_it_is_the_kalman_filter(plants: Any) -> None:
    """For gamma -> infinity x and P are the EKF's to 1e-9, also nonlinear and with gaps; else P is larger."""
    record = plants.record(plants.PENDULUM)
    run = filtered(plants.PENDULUM, record, plants.PRIOR.x0, plants.PRIOR.P0, plants.PRIOR.Q, plants.PRIOR.R)
    found = CentralHInfinity().estimate(plants.PENDULUM, record, gamma=1e8)
    np.testing.assert_allclose(found.x, run.x, rtol=0.0, atol=1e-9)
    assert found.P is not None
    np.testing.assert_allclose(found.P, run.P, rtol=0.0, atol=1e-9)
    bold = CentralHInfinity().estimate(plants.OSCILLATOR, plants.record(plants.OSCILLATOR))
    plain = CentralHInfinity().estimate(plants.OSCILLATOR, plants.record(plants.OSCILLATOR), gamma=1e8)
    assert bold.P is not None
    assert plain.P is not None
    assert np.linalg.eigvalsh(bold.P - plain.P).min() > -1e-12
    assert np.trace(bold.P[-1]) > 1.01 * np.trace(plain.P[-1])
