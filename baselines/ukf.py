"""The unscented Kalman filter of filterpy."""

from __future__ import annotations

from baselines._filterpy import alone, unscented
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class UKF(Estimator):
    """Unscented Kalman filter, filterpy's. Julier and Uhlmann (1997).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "ukf"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "white noise"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(unscented, model, record, q_scale)
