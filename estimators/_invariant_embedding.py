"""What the invariant-embedding estimators share: weights, the compiled pass, the cost, and how a run ended in words."""

from __future__ import annotations

from typing import Literal, TypedDict

import numpy as np
import numpy.typing as npt

from suite import along
from suite.estimator import Estimate
from suite.filtering import filtered, held, rates
from suite.kernels.embedding import continuous_embedding, discrete_embedding, embedding_workspace
from suite.kernels.integrate import workspace
from suite.kernels.matrix import flow_workspace
from suite.kernels.types import arrays
from suite.model import Model
from suite.prior import prior_of
from suite.record import Prior, Record
from suite.robustness import ErrorSystem, conditions, error_system

Array = npt.NDArray[np.float64]
Riccati = Literal["transition", "integration"]
Residual = Literal["before", "after"]


class Weights(TypedDict, total=False):
    """What overrides the prior's: Q, the weight of J, (n,) or (n, n); R (outputs,); S0 (n, n), the first S.

    Left out: density 1/(q_scale Q), the R of the sensors, P0/2.
    """

    Q: Array | None
    R: Array | None
    S0: Array | None


class ContinuousOptions(Weights, total=False):
    """Of a continuous filter, whose R is a spectral density: Riccati by transition matrix, or by integration."""

    riccati: Riccati


class DiscreteOptions(Weights, total=False):
    """Of a discrete filter, whose R is the variance of a sample: dhat of the residual before or after the update."""

    residual: Residual


REASONS = {
    1: "the state estimate left every bound",
    2: "S escaped to infinity",
    3: "the gain became too stiff to integrate",
}
# With less noise than this the gain settles within 1/STIFFEST of a sample, beyond what RK4 can follow in fair time.
STIFFEST = 200.0


def density(prior: Prior, q_scale: float, Q: Array | None) -> Array:
    """Q^-1, (n, n): the inverse of an explicit weight of J (n,) or (n, n), else the prior's density over `q_scale`.

    Definitions have density 0: an infinite weight, no source.
    """
    if Q is None:
        return np.diag(prior.Q) / q_scale
    weight = np.diag(Q) if np.ndim(Q) == 1 else np.asarray(Q)
    return np.linalg.inv(weight).astype(np.float64)


def cost(
    model: Model, record: Record, x: Array, d: Array, inverse: Array, alpha: float, R: Array
) -> tuple[float, float] | None:
    """J = (1/T) integral of e' R^-1 e + alpha d' Q d, its two parts, by the trapezoidal rule over the samples.

    e = z - h(xhat) (missing: 0), R (N, outputs) the spectral density, inverse (n, n) = Q^-1. The model part counts
    the equations that have a finite weight: a definition's dhat is a correction of the state, not a model error. None
    where a diverged estimate makes it overflow.
    """
    counted = np.flatnonzero(np.diag(inverse) > 0)
    weight = np.linalg.inv(inverse[np.ix_(counted, counted)])
    length = record.t[-1] - record.t[0]
    with np.errstate(all="ignore"):
        e = along.residuals(model, record, x)[0]
        data = np.nansum(e**2 / R, axis=1)
        part = alpha * np.einsum("ki,ij,kj->k", d[:, counted], weight, d[:, counted])
        J = float(np.trapezoid(data, record.t) / length), float(np.trapezoid(part, record.t) / length)
    return J if np.all(np.isfinite(J)) else None


def between_samples(model: Model, record: Record, R: Array) -> Array:
    """Variance (outputs,) of a measurement read off the line between two samples, beyond its noise R.

    A sample's distance from the line through its neighbours is four times the largest error of the lines beside it,
    whose mean square is 8/15 of its largest; noise makes 1.5 R of that distance's variance. Angles may wrap: 0.
    """
    t, y = record.t, record.y
    if len(t) < 3:
        return np.zeros_like(R)
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    off = y[1:-1] - (1.0 - share) * y[:-2] - share * y[2:]
    counts = np.maximum(np.sum(~np.isnan(off), axis=0), 1)
    excess = np.maximum(np.nansum(off**2, axis=0) / counts - 1.5 * R, 0.0) * (8.0 / 15.0) / 16.0
    return np.where(model.angles > 0, 0.0, excess)


def continuous(
    model: Model, record: Record, alpha: float, q_scale: float = 1.0, Q: Array | None = None, R: Array | None = None,
    S0: Array | None = None, riccati: Riccati = "transition",
) -> Estimate:  # fmt: skip
    """The continuous filter (47)-(55) over one run; arguments as in `ContinuousOptions`.

    By default R is R_sample dt, R_sample with the error of the line between samples (`between_samples`): without it
    a gain that trusts z would follow the kinks of that line.
    """
    prior, program = prior_of(record), model.program
    inverse = density(prior, q_scale, Q)
    W = inverse / (2.0 * alpha)
    steps = np.concatenate([record.dt[:1], record.dt])
    note = ""
    if R is None:
        H = np.atleast_2d(model.output_jacobian(record.t[0], prior.x0, record.u[0]))
        q = np.einsum("ci,ij,cj->c", H, np.abs(2.0 * W), H)
        sample = prior.R + between_samples(model, record, prior.R)
        Rk = np.maximum(sample * steps[:, None], q * steps[:, None] ** 2 / STIFFEST**2)
        if np.any(Rk > 2.0 * prior.R * steps[:, None]):
            note = "R raised to what z is known to between its samples"
    else:
        Rk = np.tile(np.asarray(R, dtype=np.float64), (len(steps), 1))
    n, N = program.n, len(record)
    X, S, D, info = np.zeros((N, n)), np.zeros((N, n, n)), np.zeros((N, n)), np.zeros(3, dtype=np.int64)
    start = prior.P0 / 2.0 if S0 is None else S0
    continuous_embedding(
        program.rate, program.output, *arrays(record.t, record.u), model.linear_inputs,
        *arrays(record.y, prior.x0, start), model.values, program.all_off(), *arrays(W, Rk), model.angles,
        int(riccati == "integration"), 4,
        embedding_workspace(n, program.inputs, program.parameters, program.outputs_count), flow_workspace(n),
        X, S, D, info,
    )  # fmt: skip
    return _estimate(model, record, X, S, D, info, inverse, alpha, Rk, note, np.asarray(start), predicted=True)


def discrete(
    model: Model, record: Record, alpha: float, q_scale: float = 1.0, Q: Array | None = None, R: Array | None = None,
    S0: Array | None = None, residual: Residual = "before",
) -> Estimate:  # fmt: skip
    """The discrete filter (63)-(74) over one run, dhat as a rate; arguments as in `DiscreteOptions`."""
    prior, program = prior_of(record), model.program
    inverse = density(prior, q_scale, Q)
    Rs = np.asarray(prior.R if R is None else R, dtype=np.float64)
    start = prior.P0 / 2.0 if S0 is None else S0
    n, N = program.n, len(record)
    X, S, jumps, info = np.zeros((N, n)), np.zeros((N, n, n)), np.zeros((N, n)), np.zeros(3, dtype=np.int64)
    work = embedding_workspace(n, program.inputs, program.parameters, program.outputs_count)
    discrete_embedding(
        program.rate, program.output, *arrays(record.t, record.u), model.linear_inputs,
        *arrays(record.y, prior.x0, start), model.values, program.all_off(),
        np.zeros(0, dtype=np.int64), *arrays(inverse / (2.0 * alpha), Rs), model.angles, int(residual == "after"),
        workspace(n, program.inputs, program.parameters, 0), work, X, S, jumps, info,
    )  # fmt: skip
    D = rates(model, record, held(X, _failed(info)), held(jumps, _failed(info)))
    Rk = Rs * np.concatenate([record.dt[:1], record.dt])[:, None]
    return _estimate(model, record, X, S, D, info, inverse, alpha, Rk, "", np.asarray(start), predicted=False)


def _failed(info: npt.NDArray[np.int64]) -> int | None:
    return None if info[0] < 0 else int(info[0])


def _estimate(
    model: Model, record: Record, X: Array, S: Array, D: Array, info: npt.NDArray[np.int64],
    inverse: Array, alpha: float, R: Array, note: str, S0: Array, *,
    predicted: bool,
) -> Estimate:  # fmt: skip
    """`predicted`: S is that of the continuous filter, which a sample has not yet made smaller."""
    failed = _failed(info)
    X, S, D = held(X, failed), held(S, failed), held(D, failed)
    report: dict[str, float | str] = {}
    status = "ok"
    if info[2] >= 0:
        report["definite until"] = float(record.t[info[2]])
        status, note = "indefinite", f"S lost definiteness at t = {record.t[info[2]]:.4g} s"
    if failed is not None:
        report["failed at"] = float(record.t[failed])
        ended = f"{REASONS[int(info[1])]} at t = {record.t[failed]:.4g} s; the last estimate is held from there"
        status, note = "diverged", f"{note}; {ended}" if note else ended
    J = cost(model, record, X, D, inverse, alpha, R)

    def examine() -> dict[str, float | str]:
        sampled = R[-1] / record.dt[-1]
        system = None if failed is not None else _errors(model, record, X, S, inverse, sampled, S0, predicted)
        return conditions(system, info[2] < 0, J, alpha)

    return Estimate(x=X, P=2.0 * S, d=D, J=J, status=status, note=note, report=report or None, examine=examine)


def _errors(
    model: Model, record: Record, X: Array, S: Array, inverse: Array, R: Array, S0: Array, predicted: bool
) -> ErrorSystem | None:
    """The error system of a run, linearised at its estimates; R (outputs,) a sample's variance. None: not finite."""
    n = X.shape[1]
    nothing = np.zeros((n, n))
    run = filtered(model, record, X[0], nothing, nothing, R, around=(X, X))
    H = run.H
    gains: Array = np.where(np.isnan(record.y)[:, None, :], 0.0, 2.0 * S @ (H / R[:, None]).transpose(0, 2, 1))
    if predicted:
        # 2 [I + 2 S H' R^-1 H]^-1 S H' R^-1: what a sample of that weight does; the first one does nothing here.
        try:
            gains = np.asarray(np.linalg.solve(np.eye(n) + gains @ H, gains), dtype=np.float64)
        except np.linalg.LinAlgError:  # an indefinite S can make it singular
            return None
        gains[0] = 0.0
    system = error_system(run.Phi, H, gains, R, inverse, 2.0 * S0, record.dt)
    return system if all(np.isfinite(part).all() for part in (system.A, system.B, system.K, system.C)) else None
