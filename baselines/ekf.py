"""The extended Kalman filter of filterpy."""

from __future__ import annotations

from baselines._filterpy import alone, extended
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class EKF(Estimator):
    """Extended Kalman filter, filterpy's. Schmidt (1966).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "ekf"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "white noise"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(extended, model, record, q_scale)
