"""A random-walk disturbance in the suspected equations, smoothed over the whole record."""

from __future__ import annotations

from estimators._disturbance import disturbed
from suite.disturbance import with_random_walk
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class RandomWalkSmoother(Estimator):
    """Extended Kalman filter and fixed-interval smoother with a disturbance state d, d' = white noise.

    Friedland (1969) for the disturbance state, Bierman (1973) for the smoother. d and P_d are the smoothed
    disturbance, in rate units. `q_scale` multiplies the density of the walk (see `with_random_walk`).
    """

    name = "random-walk-smoother"
    kind = "smoother"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "random walk"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return disturbed(with_random_walk, model, record, q_scale, smooth=True)
