"""The RTS smoother behind filterpy's extended Kalman filter with a random-walk disturbance."""

from __future__ import annotations

from typing import ClassVar, Literal

from baselines._filterpy import with_disturbance
from baselines.ekf_rts import extended_smoother
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class EKFSmootherDisturbance(Estimator):
    """Extended Kalman filter and RTS smoother, filterpy's, with a disturbance for each suspect. Friedland (1969).

    d and P_d are the disturbance states and their covariance; `q_scale` multiplies the density of their walk.
    """

    name = "ekf-rts-disturbance"
    kind: ClassVar[Literal["filter", "smoother"]] = "smoother"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "random walk"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return with_disturbance(extended_smoother, model, record, q_scale)
