"""Semi-robust adaptive estimation: the generalized filter with alpha = -gamma^2, a negative source."""

from __future__ import annotations

from dataclasses import replace
from typing import Unpack

import numpy as np
import numpy.typing as npt

from estimators._invariant_embedding import ContinuousOptions, DiscreteOptions, continuous, density, discrete
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record
from suite.robustness import norm

Array = npt.NDArray[np.float64]


def _settings(
    model: Model, record: Record, gamma: float | None, gamma_ratio: float, q_scale: float,
    Q: Array | None, R: Array | None,
) -> tuple[float, float]:  # fmt: skip
    """Gamma and the bounded-real threshold at the first state; without a gamma, `gamma_ratio` thresholds."""
    prior = prior_of(record)
    inverse = density(prior, q_scale, Q)
    # Only equations with a source count; definitions have none.
    counted = np.flatnonzero(np.diag(inverse) > 0)
    root = np.zeros((len(inverse), len(counted)))
    root[counted] = np.linalg.cholesky(inverse[np.ix_(counted, counted)])
    spectral = prior.R * float(np.median(record.dt)) if R is None else np.asarray(R, dtype=np.float64)
    F = model.jacobian(record.t[0], prior.x0, record.u[0])
    H = model.output_jacobian(record.t[0], prior.x0, record.u[0])
    slowest = 2.0 * np.pi / float(record.t[-1] - record.t[0])
    C = H / np.sqrt(spectral)[:, None]
    found = norm(F, root, C)
    scale = found if np.isfinite(found) else norm(F, root, C, slowest)
    chosen = gamma if gamma is not None else gamma_ratio * scale
    return (chosen if chosen > 0.0 else 1.0), found


def _told(estimate: Estimate, record: Record, gamma: float, found: float) -> Estimate:
    """The estimate with gamma, the threshold, the existence interval and the sign of J in its report and note."""
    J = sum(estimate.J or (0.0, 0.0))
    report = dict(estimate.report or {})
    ends = [float(report[key]) for key in ("definite until", "failed at") if key in report]
    exists = min([*ends, float(record.t[-1])])
    bound: float | str = found if np.isfinite(found) else "infinite"
    report |= {"gamma": gamma, "threshold": bound, "exists until": exists, "J sign": "+" if J >= 0.0 else "-"}
    where = f"gamma = {gamma:.4g}, threshold {found:.4g}, J {'>=' if J >= 0.0 else '<'} 0"
    return replace(estimate, report=report, note=f"{estimate.note}; {where}" if estimate.note else where)


class SemiRobustAdaptive(Estimator):
    """SRA, continuous time: alpha = -gamma^2. Raol (2016), (83)-(91) with (47)-(55).

    The source of S is negative, so S >= 0 holds for a finite time at best: `exists until` says how long, `threshold`
    is ||R^-1/2 H (sI - F)^-1 Q^-1/2||_inf at the first state, `J sign` the sign of J, which certifies nothing where S
    is not definite. gamma: as given, else gamma_ratio thresholds. Other arguments as `generalized-ie`.
    """

    name = "sra"
    tuning = {"gamma_ratio": (0.5, 1e4, "log")}

    def estimate(
        self, model: Model, record: Record, gamma: float | None = None, gamma_ratio: float = 2.0, q_scale: float = 1.0,
        **options: Unpack[ContinuousOptions],
    ) -> Estimate:  # fmt: skip
        gamma, found = _settings(model, record, gamma, gamma_ratio, q_scale, options.get("Q"), options.get("R"))
        return _told(continuous(model, record, -(gamma**2), q_scale, **options), record, gamma, found)


class SemiRobustAdaptiveDiscrete(Estimator):
    """SRA, discrete time. Raol (2016), (92)-(95).

    dhat is taken from the residual before the update, unless `residual` is "after" (as (95) is printed).
    As `sra`; R (outputs,) is the variance of a sample.
    """

    name = "sra-discrete"
    tuning = {"gamma_ratio": (0.5, 1e4, "log")}

    def estimate(
        self, model: Model, record: Record, gamma: float | None = None, gamma_ratio: float = 2.0, q_scale: float = 1.0,
        **options: Unpack[DiscreteOptions],
    ) -> Estimate:  # fmt: skip
        R = options.get("R")
        spectral = None if R is None else np.asarray(R, dtype=np.float64) * float(np.median(record.dt))
        gamma, found = _settings(model, record, gamma, gamma_ratio, q_scale, options.get("Q"), spectral)
        return _told(discrete(model, record, -(gamma**2), q_scale, **options), record, gamma, found)
