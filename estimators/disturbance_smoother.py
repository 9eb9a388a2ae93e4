"""A random-walk disturbance in the suspected equations, smoothed over the whole record."""

from __future__ import annotations

import numpy as np

from estimators._invariant_embedding import cost
from suite.disturbance import spread_out, with_random_walk
from suite.estimator import Estimate, Estimator
from suite.filtering import filtered, held
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record
from suite.smoothing import smoothed


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
        prior = prior_of(record)
        grown, start = with_random_walk(model, record, prior, q_scale)
        n = len(model.states)
        run = filtered(grown, record, start.x0, start.P0, start.Q, start.R, spread=True)
        if run.failed_at is not None:
            when = f"the filter diverged at t = {record.t[run.failed_at]:.4g} s; its last estimate is held from there"
            x = held(run.x, run.failed_at)
            d, _ = spread_out(model, x)
            return Estimate(x=x[:, :n], d=d, status="diverged", note=when)
        result = smoothed(run)
        d, P_d = spread_out(model, result.x, result.P)
        steps = np.concatenate([record.dt[:1], record.dt])
        J = cost(model, record, result.x[:, :n], d, np.diag(prior.Q), 1.0, prior.R * steps[:, None])
        report = {"log likelihood": run.log_likelihood}
        return Estimate(x=result.x[:, :n], P=result.P[:, :n, :n], d=d, P_d=P_d, J=J, report=report)
