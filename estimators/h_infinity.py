"""Central H-infinity filter: a bound gamma on the error's energy over that of the worst disturbances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from estimators._h_infinity import LEFT_BOUNDS, central, least_gamma
from suite.estimator import Estimate, Estimator
from suite.filtering import filtered, held, rates
from suite.model import Model
from suite.prior import prior_of
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]


class CentralHInfinity(Estimator):
    """Central (a posteriori) H-infinity filter. Shaked and Theodor (1992); Hassibi, Sayed, Kailath (1999), ch. 4.

    On a linear plant sum |L (x - xhat)|^2 <= gamma^2 (|x0 - xhat0|^2 P0^-1 + sum w' (Q dt)^-1 w + sum v' R^-1 v) for
    all w, v, where P^-1 + H' R^-1 H - gamma^-2 L' L > 0 at every sample; where it is not there is no such filter, and
    the status says so. gamma: as given, else `gamma_ratio` times the least one for which the filter exists over the
    record (found on the whole record: the filter itself is causal). L (rows, n): by default each state over the
    Kalman filter's own median deviation, so that gamma has no unit. P is the recursion's [P^-1 + H' R^-1 H]^-1, not
    less than the Kalman filter's covariance. d is the jump of a sample as a rate; Q the prior's density times q_scale.
    """

    name = "h-infinity"
    tuning = {"gamma_ratio": (1.01, 100.0, "log"), "q_scale": (1e-4, 1e4, "log")}

    def estimate(
        self, model: Model, record: Record, gamma: float | None = None, gamma_ratio: float = 1.5, q_scale: float = 1.0,
        L: Array | None = None,
    ) -> Estimate:  # fmt: skip
        prior = prior_of(record)
        prior = replace(prior, Q=q_scale * prior.Q)
        weight = _by_deviation(model, record, prior) if L is None else np.atleast_2d(L)
        least = least_gamma(model, record, prior, weight)
        used = gamma_ratio * least if gamma is None else gamma
        run = central(model, record, prior, weight, used)
        x, P, jump = (held(values, run.failed_at) for values in (run.x, run.P, run.jump))
        status, note = "ok", ""
        report: dict[str, float | str] = {
            "gamma": used if np.isfinite(used) else "infinite",
            "least gamma": least if np.isfinite(least) else "none",
        }
        if run.failed_at is not None:
            when = f"t = {record.t[run.failed_at]:.4g} s; the last estimate is held from there"
            report["failed at"] = float(record.t[run.failed_at])
            if run.why == LEFT_BOUNDS:
                status, note = "diverged", f"the state or its matrix left every bound at {when}"
            else:
                condition = "P^-1 + H' R^-1 H - gamma^-2 L' L > 0"
                status, note = "no filter", f"no filter attains gamma = {used:.4g}: {condition} first fails at {when}"
        return Estimate(x=x, P=P, d=rates(model, record, x, jump), status=status, note=note, report=report)


def _by_deviation(model: Model, record: Record, prior: Prior) -> Array:
    """The states over the Kalman filter's median standard deviations, (n, n); 0 for one that is known exactly."""
    run = filtered(model, record, prior.x0, prior.P0, prior.Q, prior.R)
    variance = np.median(np.diagonal(run.P[: run.failed_at], axis1=1, axis2=2), axis=0) if run.failed_at != 0 else 0.0
    deviation = np.sqrt(np.maximum(variance, 0.0)) * np.ones(len(prior.x0))
    return np.diag(np.divide(1.0, deviation, out=np.zeros_like(deviation), where=deviation > 0.0))
