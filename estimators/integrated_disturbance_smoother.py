"""An integrated-random-walk disturbance in the suspected equations, smoothed over the whole record."""

from __future__ import annotations

from estimators._disturbance import disturbed
from suite.disturbance import with_integrated_walk
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class IntegratedWalkSmoother(Estimator):
    """Extended Kalman filter and fixed-interval smoother with d' = slope, slope' = white noise.

    Young (1984) for the integrated random walk, Bierman (1973) for the smoother: on a linear plant d is a smoothing
    spline through what the model leaves. d and P_d are the smoothed disturbance and its covariance, in rate units.
    `q_scale` multiplies the density of the slope's noise (see `with_integrated_walk`).
    """

    name = "integrated-walk-smoother"
    kind = "smoother"
    tuning = {"q_scale": (1e-6, 1e6, "log")}
    optimal = "integrated walk"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return disturbed(with_integrated_walk, model, record, q_scale, smooth=True)
