"""An integrated-random-walk disturbance in the suspected equations, estimated sample by sample."""

from __future__ import annotations

from estimators._disturbance import disturbed
from suite.disturbance import with_integrated_walk
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class IntegratedWalkFilter(Estimator):
    """Extended Kalman filter with a disturbance d and its slope, d' = slope, slope' = white noise.

    Friedland (1969) for disturbance states, Young (1984) for the integrated random walk. The slope lets d follow a
    ramp without lag. d and P_d are the disturbance and its covariance, in rate units. `q_scale` multiplies the
    density of the slope's noise (see `with_integrated_walk`).
    """

    name = "integrated-walk-filter"
    tuning = {"q_scale": (1e-6, 1e6, "log")}
    optimal = "integrated walk"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return disturbed(with_integrated_walk, model, record, q_scale, smooth=False)
