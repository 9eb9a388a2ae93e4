"""The interacting multiple models of filterpy with a random-walk disturbance in the suspected equations."""

from __future__ import annotations

from baselines._filterpy import with_disturbance
from baselines.imm import interacting
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class IMMDisturbance(Estimator):
    """Interacting multiple models, filterpy's, with a disturbance state for each suspect. Friedland (1969).

    d and P_d are the disturbance states and their covariance; `q_scale` multiplies the density of their walk.
    """

    name = "imm-disturbance"
    tuning = {"q_scale": (1e-4, 1e4, "log")}

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return with_disturbance(interacting, model, record, q_scale)
