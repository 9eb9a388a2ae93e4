"""The smoother of Rauch, Tung and Striebel behind filterpy's extended Kalman filter."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from filterpy.kalman import KalmanFilter

from baselines._filterpy import Array, Pass, Plant, alone, extended, smoothed_pass
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record


def extended_smoother(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's EKF over one run, then its rts_smoother, which is linear: x <- F x.

    A last state that is always 1 carries what the nonlinear step adds to F x, so that its x(k+1) - F x(k) is the
    distance from the nonlinear prediction. That state is known, hence the pseudo-inverse.
    """
    run, plant, n = extended(model, record, prior), Plant(model, record), len(model.states)

    def smooth(last: int) -> tuple[Array, Array]:
        F, Q, P = (np.zeros((last, n + 1, n + 1)) for _ in range(3))
        x = np.column_stack([run.x[:last], np.ones(last)])
        P[:, :n, :n], F[:, n, n] = run.P[:last], 1.0
        for k in range(1, last):
            moved, F[k, :n, :n] = plant.transition(k, run.x[k - 1])
            F[k, :n, n] = moved - F[k, :n, :n] @ run.x[k - 1]
            Q[k, :n, :n] = np.diag(prior.Q * plant.dt(k))
        smooth_x, smooth_P, *_ = KalmanFilter(n + 1, 1).rts_smoother(x, P, F, Q, inv=inverse)
        return smooth_x[:, :n], smooth_P[:, :n, :n]

    return smoothed_pass(run, plant, smooth)


def inverse(P: Array) -> Array:
    """The inverse of a covariance that may be singular, the same in any units of the states."""
    scale = np.sqrt(np.maximum(np.diag(P), 0.0))
    scale = np.where(scale > 0, scale, 1.0)
    return np.asarray(np.linalg.pinv(P / np.outer(scale, scale), rcond=1e-13, hermitian=True) / np.outer(scale, scale))


class EKFSmoother(Estimator):
    """Extended Kalman filter and RTS smoother, filterpy's. Rauch, Tung and Striebel (1965).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the smoothed jump of each step as a rate.
    """

    name = "ekf-rts"
    kind: ClassVar[Literal["filter", "smoother"]] = "smoother"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "white noise"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(extended_smoother, model, record, q_scale)
