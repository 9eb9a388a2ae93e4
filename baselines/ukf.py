"""The unscented Kalman filter of filterpy."""

from __future__ import annotations

from dataclasses import replace

from baselines._filterpy import prior_of, unscented
from suite.estimator import Estimate, Estimator
from suite.kernels.jumps import rates
from suite.model import Model
from suite.record import Record


class UKF(Estimator):
    """Unscented Kalman filter, filterpy's. Julier and Uhlmann (1997).

    Process noise is q_scale Q dt a step, Q the prior's density.

    It has no model error of its own: d is the jump K nu of each sample as the rate that makes it within the step
    that ends there, as in discrete invariant embedding, so that every row has a d.
    """

    name = "ukf"
    tuning = {"q_scale": (1e-4, 1e4, "log")}  # noqa: RUF012

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:  # type: ignore[override]
        prior = prior_of(record)
        run = unscented(model, record, replace(prior, Q=q_scale * prior.Q))
        d = rates(model, record, run.x, run.jump)
        status, note = run.ending(record)
        return Estimate(x=run.x, P=run.P, d=d, status=status, note=note, report={"mean NIS": run.mean_nis})
