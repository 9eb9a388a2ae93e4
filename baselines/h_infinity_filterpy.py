"""The H-infinity filter of filterpy, linearised at each step."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
from filterpy.hinfinity import HInfinityFilter

from baselines._filterpy import Array, NoFilterError, Pass, Plant, Residual, Seen, alone, drive
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record


class _Stepped(HInfinityFilter):
    """filterpy's filter with the plant's own step in place of x <- F x, and P carried along with it.

    filterpy's update is the one-step predictor, and its predict moves the state once more. Updated with F = I and
    W = 0 it is the filter after the measurement, and the step of state and P is made here.
    """

    P: Any

    def __init__(self, states: int, outputs: int) -> None:
        with warnings.catch_warnings():
            # filterpy warns that this class is likely wrong: the reason stands above, and the update is right.
            warnings.simplefilter("ignore", DeprecationWarning)
            super().__init__(states, outputs, 0, gamma=0.0)
        self.moved, self.noise, self.slope = np.zeros(states), np.zeros((states, states)), np.eye(states)

    def predict(self, u: Any = 0) -> None:
        self.x, self.P = self.moved, self.slope @ self.P @ self.slope.T + self.noise


def h_infinity(model: Model, record: Record, prior: Prior, theta: float = 0.01) -> Pass:
    """Filterpy's HInfinityFilter over one run, from prior.x0 at the first sample, which is used too.

    P+ = P (I - theta S P + H' R^-1 H P)^-1. The weight S of the states' errors is the inverse of the variances that
    the Kalman filter with the same linearisation states, so theta has no unit; theta = 0 is that filter. Where
    P^-1 - theta S + H' R^-1 H is not positive no such filter exists, and the run ends there.
    """
    plant, n = Plant(model, record), len(model.states)
    kalman = _Stepped(n, len(model.outputs))
    kalman.x, kalman.P, kalman.gamma = prior.x0.copy(), prior.P0.copy(), theta
    plain: Array = prior.P0.copy()

    def predict(k: int) -> None:
        nonlocal plain
        kalman.moved, kalman.slope = plant.transition(k, kalman.x)
        kalman.noise = np.diag(prior.Q * plant.dt(k))
        plain = kalman.slope @ plain @ kalman.slope.T + kalman.noise
        kalman.predict()

    def update(k: int, seen: Seen, residual: Residual) -> float:
        nonlocal plain
        H, R = plant.output_jacobian(k, kalman.x)[seen], np.diag(prior.R[seen])
        e = residual(record.y[k, seen], plant.output(k, kalman.x)[seen])
        nis = float(e @ np.linalg.solve(H @ kalman.P @ H.T + R, e))
        size = np.diag(plain)
        kalman.Q = np.diag(np.where(size > 0, 1.0 / np.where(size > 0, size, 1.0), 0.0))
        kalman.H, kalman._V_inv = H, np.diag(1.0 / prior.R[seen])
        kalman.update(H @ kalman.x + e)
        plain = plain - plain @ H.T @ np.linalg.solve(H @ plain @ H.T + R, H @ plain)
        if np.linalg.eigvalsh(kalman.P / np.sqrt(np.outer(size, size) + (size == 0)))[0] < -1e-9:
            raise NoFilterError(f"no H-infinity filter with theta = {theta:.3g} exists")
        return nis

    return drive(kalman, model, record, predict, update)


class HInfinity(Estimator):
    """H-infinity filter, filterpy's. Simon (2006), equations (11.89)-(11.90).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "h-infinity-filterpy"
    tuning = {"q_scale": (1e-4, 1e4, "log"), "theta": (1e-5, 0.1, "log")}

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0, theta: float = 0.01) -> Estimate:
        return alone(partial(h_infinity, theta=theta), model, record, q_scale)
