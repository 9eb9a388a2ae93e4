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

Array = npt.NDArray[np.float64]


def threshold(F: Array, G: Array, C: Array, slowest: float = 0.0) -> float:
    """The H-infinity norm of C (sI - F)^-1 G, by bisection on the Hamiltonian (Boyd, Balakrishnan, Kabamba 1989).

    F (n, n), G (n, m), C (outputs, n). Where F is not stable the norm is infinite, and with `slowest` (rad/s) the
    largest gain at frequencies above it is given instead.
    """
    n = len(F)

    def gain(w: float) -> float:
        return float(np.linalg.norm(C @ np.linalg.solve(1j * w * np.eye(n) - F, G.astype(complex)), 2))

    eigenvalues = np.linalg.eigvals(F)
    pace = float(np.max(np.abs(eigenvalues))) + 1e-12
    if np.max(eigenvalues.real) >= -1e-9 * pace:
        if slowest <= 0.0 or not G.size:
            return float("inf") if G.size else 0.0
        return max(gain(float(w)) for w in np.geomspace(slowest, max(1e3 * pace, 1e3 * slowest), 400))
    low = max(gain(float(w)) for w in [0.0, *np.abs(eigenvalues)]) if G.size else 0.0
    if low == 0.0:
        return 0.0
    high = 2.0 * low
    while _crosses(F, G, C, high):
        high *= 2.0
    while high - low > 1e-10 * high:
        middle = 0.5 * (low + high)
        if _crosses(F, G, C, middle):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _crosses(F: Array, G: Array, C: Array, gamma: float) -> bool:
    """Whether some frequency has the gain gamma: the Hamiltonian then has an eigenvalue on the imaginary axis."""
    # G and C carry half of gamma each, which keeps the blocks of one size.
    hamiltonian = np.block([[F, G @ G.T / gamma], [-C.T @ C / gamma, -F.T]])
    eigenvalues = np.linalg.eigvals(hamiltonian)
    return bool(np.any(np.abs(eigenvalues.real) < 1e-8 * np.max(np.abs(eigenvalues))))


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
    found = threshold(F, root, C)
    scale = found if np.isfinite(found) else threshold(F, root, C, slowest)
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
