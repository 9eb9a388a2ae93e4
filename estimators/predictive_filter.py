"""Predictive filter: the model error of a step is what the next measurement asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from estimators._invariant_embedding import cost
from estimators._predictive import Array, predicted, prediction
from suite.estimator import Estimate, Estimator
from suite.filtering import held
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record


class PredictiveFilter(Estimator):
    """Predictive filter, one step ahead. Crassidis and Markley (1997).

    d, constant over a step, minimises (y - yhat)' R^-1 (y - yhat) + d' W d at the step's end, where yhat is expanded
    in Lie derivatives up to the relative degree of each output. d at a sample is that of the step that ends there.
    W = w_scale dt / Q, Q the prior's density. `constrained` instead chooses w_scale by the covariance constraint: the
    residual variance over R, in the report as "covariance ratio", becomes 1 (or as near as it gets). The first state
    is the prior's, which no measurement corrects; there is no covariance.
    """

    name = "predictive-filter"
    tuning = {"w_scale": (1e-6, 1e4, "log")}

    def skip(self, model: Model, record: Record) -> str | None:
        if model.suspects and not prediction(model).degree.any():
            return "no output responds to an error in a suspected equation, at any order of its derivatives"
        return None

    def estimate(self, model: Model, record: Record, w_scale: float = 1.0, constrained: bool = False) -> Estimate:
        prior = prior_of(record)
        at = [list(model.states).index(name) for name in model.suspects]

        def ratio(scale: float) -> float:
            _, _, Y, failed = predicted(model, record, prior.x0, prior.Q[at] / scale, prior.R)
            return np.inf if failed is not None else _covariance_ratio(model, record, Y, prior.R)

        if constrained:
            w_scale = _crossing(ratio, 1e-8, 1e8)
        x, d, Y, failed = predicted(model, record, prior.x0, prior.Q[at] / w_scale, prior.R)
        report = {"w_scale": w_scale}
        if failed is not None:
            note = f"the state left every bound at t = {record.t[failed]:.4g} s; the last estimate is held from there"
            return Estimate(x=held(x, failed), d=held(d, failed), status="diverged", note=note, report=report)
        report["covariance ratio"] = _covariance_ratio(model, record, Y, prior.R)
        steps = np.concatenate([record.dt[:1], record.dt])
        J = cost(model, record, x, d, np.diag(prior.Q / w_scale), 1.0, prior.R * steps[:, None])
        return Estimate(x=x, d=d, J=J, report=report)


def _covariance_ratio(model: Model, record: Record, Y: Array, R: Array) -> float:
    e = record.y - Y
    wraps = model.angles > 0
    e[:, wraps] = np.arctan2(np.sin(e[:, wraps]), np.cos(e[:, wraps]))
    return float(np.nanmean(e**2 / R)) if np.isfinite(e).any() else 0.0


def _crossing(ratio: Callable[[float], float], low: float, high: float) -> float:
    """The scale at which the ratio, small at `low` and large at `high`, is 1, to 0.1 %; else the nearer end."""
    while high / low > 1.001:
        middle = float(np.sqrt(low * high))
        if ratio(middle) < 1.0:
            low = middle
        else:
            high = middle
    return float(np.sqrt(low * high))
