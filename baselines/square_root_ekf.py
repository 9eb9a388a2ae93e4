"""The square-root Kalman filter of filterpy, linearised at each step."""

from __future__ import annotations

from typing import Any

import numpy as np
from filterpy.kalman import SquareRootKalmanFilter

from baselines._filterpy import Array, Pass, Plant, Residual, Seen, alone, drive, root
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record


class _Stepped(SquareRootKalmanFilter):
    """filterpy's square-root filter with the plant's own step in place of x <- F x."""

    def __init__(self, states: int, outputs: int) -> None:
        super().__init__(states, outputs)
        self.moved: Array = np.zeros(states)

    def predict(self, u: Any = 0) -> None:
        super().predict(u)
        self.x = self.moved


def square_root(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's SquareRootKalmanFilter over one run, from prior.x0 at the first sample, which is used too.

    filterpy 2.0 has no nonlinear square-root filter: F and H are the plant's derivatives at the estimate, and the
    measurement is shifted so that its z - H x is the nonlinear residual. Its setters of P and Q take Cholesky's root,
    which a singular matrix lacks (definitions have no noise), so the roots are set themselves.
    """
    plant, n = Plant(model, record), len(model.states)
    kalman = _Stepped(n, len(model.outputs))
    kalman.x, kalman._P1_2 = prior.x0.copy(), root(prior.P0).T

    def predict(k: int) -> None:
        kalman.moved, kalman.F = plant.transition(k, kalman.x)
        kalman._Q1_2 = np.diag(np.sqrt(prior.Q * plant.dt(k)))
        kalman.predict()

    def update(k: int, seen: Seen, residual: Residual) -> float:
        m = int(seen.sum())
        kalman.dim_z, kalman.M, kalman.H = m, np.zeros((m + n, m + n)), plant.output_jacobian(k, kalman.x)[seen]
        e = residual(record.y[k, seen], plant.output(k, kalman.x)[seen])
        kalman.update(kalman.H @ kalman.x + e, R2=np.diag(np.sqrt(prior.R[seen])))
        return float(e @ kalman.SI @ e)

    return drive(kalman, model, record, predict, update)


class SquareRootEKF(Estimator):
    """Extended Kalman filter in square-root form, filterpy's. Kaminski, Bryson and Schmidt (1971).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "square-root-ekf"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "white noise"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(square_root, model, record, q_scale)
