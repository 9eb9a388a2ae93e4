"""The H-infinity filter of filterpy with a random-walk disturbance in the suspected equations."""

from __future__ import annotations

from functools import partial

from baselines._filterpy import with_disturbance
from baselines.h_infinity_filterpy import h_infinity
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class HInfinityDisturbance(Estimator):
    """H-infinity filter, filterpy's, with a disturbance state for each suspect. Friedland (1969).

    d and P_d are the disturbance states and their covariance; `q_scale` multiplies the density of their walk.
    """

    name = "h-infinity-filterpy-disturbance"
    tuning = {"q_scale": (1e-4, 1e4, "log"), "theta": (1e-5, 0.1, "log")}

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0, theta: float = 0.01) -> Estimate:
        return with_disturbance(partial(h_infinity, theta=theta), model, record, q_scale)
