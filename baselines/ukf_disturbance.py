"""The unscented Kalman filter of filterpy with a random-walk disturbance in the suspected equations."""

from __future__ import annotations

from baselines._filterpy import unscented, with_disturbance
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class UKFDisturbance(Estimator):
    """Unscented Kalman filter, filterpy's, with a disturbance state for each suspect. Friedland (1969).

    d and P_d are the disturbance states and their covariance; `q_scale` multiplies the density of their walk.
    """

    name = "ukf-disturbance"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "random walk"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return with_disturbance(unscented, model, record, q_scale)
