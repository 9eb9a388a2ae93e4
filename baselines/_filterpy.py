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
from suite.kernels.integrate import advance, workspace
from suite.kernels.types import arrays
from suite.model import Model
from suite.prior import prior_of
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# Beyond this a state is lost, whatever its unit; numpy would soon warn of overflow.
LOST = 1e100


class NoFilterError(ValueError):
    """A filter that is not defined from here on, with the reason in a sentence that "at t = ..." may follow."""


@dataclass(frozen=True)
class Pass:
    """One run of a filter: x (N, n), P (N, n, n), jump (N, n) = x - x_prior, nis (N,) (NaN where nothing was measured),
    failed_at: None, or the sample at which the filter broke, and why; what follows then repeats the last sound sample.
    """

    x: Array
    P: Array
    jump: Array
    nis: Array
    failed_at: int | None = None
    why: str = "the filter diverged"

    @property
    def mean_nis(self) -> float:
        """The mean normalised innovation squared; its expectation is the number of channels measured."""
        return float(np.nanmean(self.nis)) if np.any(np.isfinite(self.nis)) else 0.0

    def estimate(self, record: Record, x: Array, P: Array, d: Array, P_d: Array | None = None) -> Estimate:
        """The pass as an Estimate, with how it ended."""
        status, note = "ok", ""
        if self.failed_at is not None:
            status = "diverged"
            note = f"{self.why} at t = {record.t[self.failed_at]:.4g} s; the last estimate is held from there"
        return Estimate(x=x, P=P, d=d, P_d=P_d, status=status, note=note, report={"mean NIS": self.mean_nis})


Kind = Callable[[Model, Record, Prior], Pass]
Seen = npt.NDArray[np.bool_]
Residual = Callable[[Array, Array], Array]


class Plant:
    """A model along a record: what a filter needs of it at sample k, where step k ends.

    A filter asks some ten times a sample, so everything that does not change is made once.
    """

    def __init__(self, model: Model, record: Record) -> None:
        self.model, self.record = model, record
        program = model.program
        self._t, self._u = record.t.tolist(), list(record.u)
        self._rate, self._output = program.rate, program.output
        self._values, self._linear = arrays(model.values, model.linear_inputs)
        self._off, self._none = program.all_off(), np.zeros(0, dtype=np.int64)
        self._work = workspace(program.n, program.inputs, program.parameters, 0)
        self._by_p = np.zeros((program.outputs_count, program.parameters))

    def dt(self, k: int) -> float:
        """The length of step k."""
        return float(self._t[k] - self._t[k - 1])

    def transition(self, k: int, x: Array) -> tuple[Array, Array]:
        """The state at sample k from x (n,) at k - 1, and its derivative by x, (n, n)."""
        after = np.array(x, dtype=np.float64)
        T = np.empty((len(after), len(after)))
        advance(
            self._rate, self._t[k - 1], self._t[k] - self._t[k - 1], self._u[k - 1], self._u[k], self._linear,
            self._values, self._off, self._none, 1, after, T, self._work,
        )  # fmt: skip
        return after, T

    def step(self, k: int, x: Array) -> Array:
        """The state at sample k from x (n,) at k - 1."""
        return self.transition(k, x)[0]

    def outputs(self, k: int, x: Array) -> tuple[Array, Array]:
        """The outputs at sample k, (outputs,), and their derivative by x, (outputs, n)."""
        h, H = np.zeros(len(self._by_p)), np.zeros((len(self._by_p), len(x)))
        point = np.ascontiguousarray(x, dtype=np.float64)
        self._output(self._t[k], point, self._u[k], self._values, self._off, h, H, self._by_p)
        return h, H

    def output(self, k: int, x: Array) -> Array:
        """The outputs at sample k, (outputs,)."""
        return self.outputs(k, x)[0]

    def output_jacobian(self, k: int, x: Array) -> Array:
        """Their derivative by x, (outputs, n)."""
        return self.outputs(k, x)[1]


class SteppedEKF(ExtendedKalmanFilter):
    """filterpy's EKF with the plant's own step in place of x <- F x."""

    def __init__(self, states: int, outputs: int) -> None:
        super().__init__(states, outputs)
        self.moved: Array = np.zeros(states)

    def predict_x(self, u: Any = 0) -> None:
        self.x = self.moved


def extended(model: Model, record: Record, prior: Prior, inflation: float = 1.0) -> Pass:
    """Filterpy's ExtendedKalmanFilter over one run, from prior.x0 at the first sample, which is used too.

    `inflation` multiplies the predicted covariance, per unit of time.
    """
    plant = Plant(model, record)
    ekf = SteppedEKF(len(model.states), len(model.outputs))
    ekf.x, ekf.P = prior.x0.copy(), prior.P0.copy()

    def predict(k: int) -> None:
        ekf.moved, ekf.F = plant.transition(k, ekf.x)
        ekf.Q = np.diag(prior.Q * plant.dt(k))
        ekf.predict()
        if inflation != 1.0:
            ekf.P = inflation ** plant.dt(k) * ekf.P

    def update(k: int, seen: Seen, residual: Residual) -> float:
        h, H = plant.outputs(k, ekf.x)
        ekf.update(record.y[k, seen], lambda _: H[seen], lambda _: h[seen], R=np.diag(prior.R[seen]), residual=residual)
        return float(ekf.y @ ekf.SI @ ekf.y)

    return drive(ekf, model, record, predict, update)


def unscented(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's UnscentedKalmanFilter over one run (sigma points of Van der Merwe, alpha = 1, beta = 2, kappa = 0)."""
    plant, ukf = Plant(model, record), unscented_filter(model)
    ukf.x, ukf.P = prior.x0.copy(), prior.P0.copy()
    # The first sample is an update without a prediction: its sigma points are drawn here.
    ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)

    def predict(k: int) -> None:
        ukf.Q = np.diag(prior.Q * plant.dt(k))
        ukf.predict(fx=lambda x, dt: plant.step(k, x))

    def update(k: int, seen: Seen, residual: Residual) -> float:
        ukf.residual_z = residual
        ukf.z_mean = lambda sigmas, weights: _mean(sigmas, weights, residual)
        ukf.update(record.y[k, seen], R=np.diag(prior.R[seen]), hx=lambda x: plant.output(k, x)[seen])
        return float(ukf.y @ ukf.SI @ ukf.y)

    return drive(ukf, model, record, predict, update)


def unscented_filter(model: Model) -> UnscentedKalmanFilter:
    """The filter object of `unscented`, without functions of the plant."""
    # With kappa = 0 and alpha = 1 no weight is negative, so that P stays a covariance.
    points = MerweScaledSigmaPoints(len(model.states), 1.0, 2.0, 0.0, sqrt_method=root)
    return UnscentedKalmanFilter(len(model.states), len(model.outputs), 1.0, hx=None, fx=None, points=points)


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


def drive(
    kalman: Any,
    model: Model,
    record: Record,
    predict: Callable[[int], None],
    update: Callable[[int, Seen, Residual], float],
    missed: Callable[[], None] = lambda: None,
) -> Pass:
    """Drive a filter object with x and P over a record. `predict` makes step k; `update` takes the channels seen at
    sample k and gives their normalised innovation squared; `missed` is called where nothing was measured.
    """
    N, n = len(record), len(model.states)
    x, P, jump, nis = np.zeros((N, n)), np.zeros((N, n, n)), np.zeros((N, n)), np.full(N, np.nan)
    angle, why = model.angles > 0, Pass.why
    for k in range(N):
        seen = ~np.isnan(record.y[k])
        try:
            with np.errstate(all="ignore"):
                if k > 0:
                    predict(k)
                ahead = np.ravel(kalman.x).copy()
                if seen.any():
                    nis[k] = update(k, seen, _residual(angle[seen]))
                else:
                    missed()
                broken = not (np.all(np.abs(kalman.x) < LOST) and np.all(np.abs(kalman.P) < LOST))
        except (np.linalg.LinAlgError, ValueError, OverflowError) as error:
            broken, why = True, str(error) if isinstance(error, NoFilterError) else why
        if broken:
            x[k:], P[k:] = (x[k - 1], P[k - 1]) if k else (0.0, 0.0)
            nis[k:] = np.nan
            return Pass(x, P, jump, nis, k, why)
        x[k], P[k] = np.ravel(kalman.x), kalman.P
        jump[k] = x[k] - ahead
    return Pass(x, P, jump, nis)


def smoothed_pass(run: Pass, plant: Plant, smooth: Callable[[int], tuple[Array, Array]]) -> Pass:
    """A filter's run smoothed by `smooth`, which gives x and P of the first samples; jump is x - step(x) along it.

    What follows a failure of the filter is held, as it does.
    """
    last = len(run.x) if run.failed_at is None else run.failed_at
    x, P, jump, failed = run.x.copy(), run.P.copy(), np.zeros_like(run.x), run.failed_at
    if last > 1:
        try:
            with np.errstate(all="ignore"):
                x[:last], P[:last] = smooth(last)
                jump[1:last] = [x[k] - plant.step(k, x[k - 1]) for k in range(1, last)]
            sound = bool(np.all(np.abs(x) < LOST) and np.all(np.abs(P) < LOST) and np.all(np.abs(jump) < LOST))
        except np.linalg.LinAlgError:
            sound = False
        if not sound:
            return replace(run, failed_at=0 if failed is None else failed)
        x[last:], P[last:] = x[last - 1], P[last - 1]
    return Pass(x, 0.5 * (P + P.transpose(0, 2, 1)), jump, run.nis, failed, run.why)


def _residual(angle: Seen) -> Residual:
    """Z - h, on [-pi, pi] where it is an angle's."""
    if not angle.any():
        return np.subtract

    def residual(z: Array, h: Array) -> Array:
        e = np.subtract(z, h)
        return np.where(angle, np.arctan2(np.sin(e), np.cos(e)), e)

    return residual


def _mean(sigmas: Array, weights: Array, residual: Residual) -> Array:
    """The weighted mean, taken around the first sigma point, which also holds for angles."""
    offsets = np.array([residual(point, sigmas[0]) for point in sigmas])
    return np.asarray(sigmas[0] + weights @ offsets)


def root(P: Array) -> Array:
    """U with U' U = P, also for a singular P (known initial states), for which Cholesky's method fails."""
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
