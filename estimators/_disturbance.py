"""What the estimators with disturbance states share: the pass of the grown model, forward or both ways."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from estimators._invariant_embedding import cost
from suite.disturbance import spread_out
from suite.estimator import Estimate
from suite.filtering import filtered, held
from suite.model import Model
from suite.prior import prior_of
from suite.record import Prior, Record
from suite.smoothing import smoothed

Grow = Callable[[Model, Record, Prior, float], tuple[Model, Prior]]


def disturbed(grow: Grow, model: Model, record: Record, q_scale: float, *, smooth: bool) -> Estimate:
    """Filter, or filter and smoother, of the model that `grow` gives disturbance states; d and P_d are these states.

    `q_scale` multiplies the density of their noise. J counts the prior's Q as the weight of d, as everywhere.
    """
    prior, n = prior_of(record), len(model.states)
    grown, start = grow(model, record, prior, q_scale)
    run = filtered(grown, record, start.x0, start.P0, start.Q, start.R, spread=True)
    if run.failed_at is not None:
        x = held(run.x, run.failed_at)
        return Estimate(x=x[:, :n], d=spread_out(model, x)[0], status="diverged", note=run.failure(record.t))
    x, P = run.x, run.P
    if smooth:
        both = smoothed(run)
        x, P = both.x, both.P
    d, P_d = spread_out(model, x, P)
    steps = np.concatenate([record.dt[:1], record.dt])
    J = cost(model, record, x[:, :n], d, np.diag(prior.Q), 1.0, prior.R * steps[:, None])
    report = {"log likelihood": run.log_likelihood}
    return Estimate(x=x[:, :n], P=P[:, :n, :n], d=d, P_d=P_d, J=J, report=report)
