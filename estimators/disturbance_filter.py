"""A random-walk disturbance in the suspected equations, estimated sample by sample."""

from __future__ import annotations

from estimators._disturbance import disturbed
from suite.disturbance import with_random_walk
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class RandomWalkFilter(Estimator):
    """Extended Kalman filter with a disturbance state d, d' = white noise. Friedland (1969).

    The forward half of `random-walk-smoother`. d and P_d are the disturbance and its covariance, in rate units.
    `q_scale` multiplies the density of the walk (see `with_random_walk`).
    """

    name = "random-walk-filter"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "random walk"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return disturbed(with_random_walk, model, record, q_scale, smooth=False)
