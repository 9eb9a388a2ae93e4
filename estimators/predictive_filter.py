"""Predictive filter: the model error of a step is what the next measurement asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from estimators._invariant_embedding import cost
from estimators._predictive import predicted, prediction
from suite.estimator import Estimate, Estimator
from suite.filtering import held
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record

Array = npt.NDArray[np.float64]


class PredictiveFilter(Estimator):
    """Predictive filter, one step ahead. Crassidis and Markley (1997).

    d, constant over a step, minimises (y - yhat)' R^-1 (y - yhat) + d' W d at the step's end, where yhat is expanded
    in Lie derivatives up to the relative degree of each output. d at a sample is that of the step that ends there.
    W = w_scale dt / Q, Q the prior's density. w_scale None: chosen from the whole record by the covariance constraint,
    the largest at which the mean of e^2 / R, e = y - h(xhat), reported as "covariance ratio", is 1 (else as near to 1
    as it gets). The first state is the prior's, which no measurement corrects; there is no covariance.
    """

    name = "predictive-filter"
    tuning = {"w_scale": (1e-6, 1e4, "log")}

    def skip(self, model: Model, record: Record) -> str | None:
        if model.suspects and not prediction(model).degree.any():
            return "no output responds to an error in a suspected equation, at any order of its derivatives"
        return None

    def estimate(self, model: Model, record: Record, w_scale: float | None = 1.0) -> Estimate:
        prior = prior_of(record)
        density = prior.Q[[list(model.states).index(name) for name in model.suspects]]

        def ratio(scale: float) -> float:
            _, _, Y, failed = predicted(model, record, prior.x0, density / scale, prior.R)
            return np.inf if failed is not None else _covariance_ratio(model, record, Y, prior.R)

        scale = constrained(ratio) if w_scale is None else w_scale
        x, d, Y, failed = predicted(model, record, prior.x0, density / scale, prior.R)
        report = {"w_scale": scale}
        if failed is not None:
            note = f"the state left every bound at t = {record.t[failed]:.4g} s; the last estimate is held from there"
            return Estimate(x=held(x, failed), d=held(d, failed), status="diverged", note=note, report=report)
        report["covariance ratio"] = _covariance_ratio(model, record, Y, prior.R)
        steps = np.concatenate([record.dt[:1], record.dt])
        J = cost(model, record, x, d, np.diag(prior.Q / scale), 1.0, prior.R * steps[:, None])
        return Estimate(x=x, d=d, J=J, report=report)


def _covariance_ratio(model: Model, record: Record, Y: Array, R: Array) -> float:
    """The mean of e^2 / R over all readings, e = y - Y wrapped where an output is an angle."""
    e = record.y - Y
    wraps = model.angles > 0
    e[:, wraps] = np.arctan2(np.sin(e[:, wraps]), np.cos(e[:, wraps]))
    with np.errstate(over="ignore"):
        return float(np.nanmean(e**2 / R)) if np.isfinite(e).any() else 0.0


def constrained(ratio: Callable[[float], float]) -> float:
    """The largest scale in 1e-6 ... 1e6 at which the ratio is 1, to 1 %; the one of the smallest ratio if none is.

    The ratio falls with the scale, but not always: an output of relative degree two is followed with little damping
    where W is large, so that the ratio may cross 1 more than once.
    """
    scales = np.geomspace(1e6, 1e-6, 37)
    best, least = float(scales[0]), np.inf
    for before, scale in zip([scales[0], *scales[:-1]], scales, strict=True):
        found = ratio(float(scale))
        if found < least:
            best, least = float(scale), found
        if found <= 1.0:
            low, high = float(scale), float(before)
            while high > 1.01 * low:
                middle = float(np.sqrt(low * high))
                low, high = (middle, high) if ratio(middle) <= 1.0 else (low, middle)
            return low
    return best
