"""filterpy's filters on a Model and a Record: the whole adapter.

filterpy >= 2.0 is driven by predict() and update() apart (its predict_update keeps a stale x_prior), with a nonlinear
predict_x (linear as shipped); the normalised innovation squared is computed here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from suite.disturbance import spread_out, with_random_walk
from suite.estimator import Estimate
from suite.filtering import rates
from suite.model import Model
from suite.prior import prior_of
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# Beyond this a state is lost, whatever its unit; numpy would soon warn of overflow.
LOST = 1e100


@dataclass(frozen=True)
class Pass:
    """One run of a filter: x (N, n), P (N, n, n), jump (N, n) = x - x_prior, nis (N,) (NaN where nothing was measured),
    failed_at: None, or the sample at which the filter broke; what follows then repeats the last sound sample.
    """

    x: Array
    P: Array
    jump: Array
    nis: Array
    failed_at: int | None = None

    @property
    def mean_nis(self) -> float:
        """The mean normalised innovation squared; its expectation is the number of channels measured."""
        return float(np.nanmean(self.nis)) if np.any(np.isfinite(self.nis)) else 0.0

    def estimate(self, record: Record, x: Array, P: Array, d: Array, P_d: Array | None = None) -> Estimate:
        """The pass as an Estimate, with how it ended."""
        status, note = "ok", ""
        if self.failed_at is not None:
            status = "diverged"
            note = f"the filter diverged at t = {record.t[self.failed_at]:.4g} s; the last estimate is held from there"
        return Estimate(x=x, P=P, d=d, P_d=P_d, status=status, note=note, report={"mean NIS": self.mean_nis})


Kind = Callable[[Model, Record, Prior], Pass]


class _SteppedEKF(ExtendedKalmanFilter):
    """filterpy's EKF with the plant's own step in place of x <- F x."""

    def __init__(self, states: int, outputs: int) -> None:
        super().__init__(states, outputs)
        self.moved: Array = np.zeros(states)

    def predict_x(self, u: Any = 0) -> None:
        self.x = self.moved


def extended(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's ExtendedKalmanFilter over one run, from prior.x0 at the first sample, which is used too."""
    ekf = _SteppedEKF(len(model.states), len(model.outputs))
    ekf.x, ekf.P = prior.x0.copy(), prior.P0.copy()

    def predict(k: int, dt: float) -> None:
        u, u_next = record.u[k - 1], record.u[k]
        ekf.moved, ekf.F = model.transition(float(record.t[k - 1]), ekf.x, tuple(u), dt, tuple(u_next))
        ekf.Q = np.diag(prior.Q * dt)
        ekf.predict()

    def update(k: int, seen: npt.NDArray[np.bool_], residual: Callable[[Array, Array], Array]) -> None:
        t, u = float(record.t[k]), tuple(record.u[k])
        ekf.update(
            record.y[k, seen],
            lambda x: model.output_jacobian(t, x, u)[seen],
            lambda x: model.output(t, x, u)[seen],
            R=np.diag(prior.R[seen]),
            residual=residual,
        )

    return _run(ekf, model, record, predict, update)


def unscented(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's UnscentedKalmanFilter over one run (sigma points of Van der Merwe, alpha = 1, beta = 2, kappa = 0)."""
    # With kappa = 0 and alpha = 1 no weight is negative, so that P stays a covariance.
    points = MerweScaledSigmaPoints(len(model.states), 1.0, 2.0, 0.0, sqrt_method=_root)
    ukf = UnscentedKalmanFilter(len(model.states), len(model.outputs), 1.0, hx=None, fx=None, points=points)
    ukf.x, ukf.P = prior.x0.copy(), prior.P0.copy()
    # The first sample is an update without a prediction: its sigma points are drawn here.
    ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)

    def predict(k: int, dt: float) -> None:
        t, u, u_next = float(record.t[k - 1]), tuple(record.u[k - 1]), tuple(record.u[k])
        ukf.Q = np.diag(prior.Q * dt)
        ukf.predict(dt=dt, fx=lambda x, dt: model.step(t, x, u, dt, u_next))

    def update(k: int, seen: npt.NDArray[np.bool_], residual: Callable[[Array, Array], Array]) -> None:
        t, u = float(record.t[k]), tuple(record.u[k])
        ukf.residual_z = residual
        ukf.z_mean = lambda sigmas, weights: _mean(sigmas, weights, residual)
        ukf.update(record.y[k, seen], R=np.diag(prior.R[seen]), hx=lambda x: model.output(t, x, u)[seen])

    return _run(ukf, model, record, predict, update)


def alone(kind: Kind, model: Model, record: Record, q_scale: float) -> Estimate:
    """A filter by itself, with process noise q_scale Q dt a step, Q the prior's density.

    It has no model error of its own: d is the jump K nu of each sample as the rate that makes it within the step
    that ends there, as in discrete invariant embedding, so that every row has a d.
    """
    prior = prior_of(record)
    run = kind(model, record, replace(prior, Q=q_scale * prior.Q))
    return run.estimate(record, run.x, run.P, rates(model, record, run.x, run.jump))


def with_disturbance(kind: Kind, model: Model, record: Record, q_scale: float) -> Estimate:
    """A filter with a disturbance state for each suspect: d and P_d are these states and their covariance.

    `q_scale` multiplies the density of their walk (see `with_random_walk`).
    """
    grown, start = with_random_walk(model, record, prior_of(record), q_scale)
    run = kind(grown, record, start)
    n = len(model.states)
    return run.estimate(record, run.x[:, :n], run.P[:, :n, :n], *spread_out(model, run.x, run.P))


def _run(
    kalman: Any, model: Model, record: Record, predict: Callable[[int, float], None], update: Callable[..., None]
) -> Pass:
    N, n = len(record), len(model.states)
    x, P, jump, nis = np.zeros((N, n)), np.zeros((N, n, n)), np.zeros((N, n)), np.full(N, np.nan)
    angle = model.angles > 0
    for k in range(N):
        seen = ~np.isnan(record.y[k])
        try:
            with np.errstate(all="ignore"):
                if k > 0:
                    predict(k, float(record.t[k] - record.t[k - 1]))
                ahead = kalman.x.copy()
                if seen.any():
                    update(k, seen, _residual(angle[seen]))
                    nis[k] = float(kalman.y @ kalman.SI @ kalman.y)
                broken = not (np.all(np.abs(kalman.x) < LOST) and np.all(np.abs(kalman.P) < LOST))
        except (np.linalg.LinAlgError, ValueError, OverflowError):
            broken = True
        if broken:
            x[k:], P[k:] = (x[k - 1], P[k - 1]) if k else (0.0, 0.0)
            nis[k:] = np.nan
            return Pass(x, P, jump, nis, k)
        x[k], P[k], jump[k] = kalman.x, kalman.P, kalman.x - ahead
    return Pass(x, P, jump, nis)


def _residual(angle: npt.NDArray[np.bool_]) -> Callable[[Array, Array], Array]:
    """Z - h, on [-pi, pi] where it is an angle's."""

    def residual(z: Array, h: Array) -> Array:
        e = np.subtract(z, h)
        return np.where(angle, np.arctan2(np.sin(e), np.cos(e)), e)

    return residual


def _mean(sigmas: Array, weights: Array, residual: Callable[[Array, Array], Array]) -> Array:
    """The weighted mean, taken around the first sigma point, which also holds for angles."""
    offsets = np.array([residual(point, sigmas[0]) for point in sigmas])
    return np.asarray(sigmas[0] + weights @ offsets)


def _root(P: Array) -> Array:
    """U with U' U = P, also for a singular P (known initial states), for which Cholesky's method fails."""
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
