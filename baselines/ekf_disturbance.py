"""The extended Kalman filter of filterpy with a random-walk disturbance in the suspected equations."""

from __future__ import annotations

from baselines._filterpy import extended, prior_of
from suite.disturbance import spread_out, with_random_walk
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class EKFDisturbance(Estimator):
    """Extended Kalman filter, filterpy's, with a disturbance state for each suspect. Friedland (1969).

    d and P_d are the disturbance states and their covariance; `q_scale` multiplies the density of their walk
    (see `with_random_walk`).
    """

    name = "ekf-disturbance"
    tuning = {"q_scale": (1e-4, 1e4, "log")}  # noqa: RUF012

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:  # type: ignore[override]
        grown, start = with_random_walk(model, record, prior_of(record), q_scale)
        run = extended(grown, record, start)
        n = len(model.states)
        d, P_d = spread_out(model, run.x, run.P)
        status, note = run.ending(record)
        return Estimate(
            x=run.x[:, :n],
            P=run.P[:, :n, :n],
            d=d,
            P_d=P_d,
            status=status,
            note=note,
            report={"mean NIS": run.mean_nis},
        )
