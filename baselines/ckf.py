"""The cubature Kalman filter of filterpy."""

from __future__ import annotations

from typing import Any

import numpy as np
from filterpy.kalman import CubatureKalmanFilter
from filterpy.kalman.CubatureKalmanFilter import ckf_transform

from baselines._filterpy import Array, Pass, Plant, Residual, Seen, alone, drive, root
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record


class _Redrawn(CubatureKalmanFilter):
    """filterpy's CKF with its points drawn by a root that a singular P has too (first states that are known), and
    drawn anew after the prediction as Arasaratnam and Haykin do: filterpy 2.0 leaves Q out of the gain.
    """

    x: Any
    P: Any

    def draw(self) -> None:
        """Points x +- sqrt(n) (column of the root of P), (2 n, n)."""
        spread = np.sqrt(self.dim_x) * root(self.P)
        self.sigmas_f = np.ravel(self.x) + np.vstack([spread, -spread])

    def predict(self, dt: Any = None, fx_args: Any = ()) -> None:
        self.draw()
        self.x, self.P = ckf_transform(np.array([self.fx(point, dt) for point in self.sigmas_f]), self.Q)
        self.draw()


def cubature(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's CubatureKalmanFilter over one run, from prior.x0 at the first sample, which is used too."""
    plant = Plant(model, record)
    ckf = _Redrawn(len(model.states), len(model.outputs), 1.0, hx=None, fx=None)
    ckf.x, ckf.P = prior.x0[:, None].copy(), prior.P0.copy()
    ckf.draw()

    def predict(k: int) -> None:
        ckf.Q, ckf.fx = np.diag(prior.Q * plant.dt(k)), lambda x, dt: plant.step(k, x)
        ckf.predict()

    def update(k: int, seen: Seen, residual: Residual) -> float:
        # The outputs are counted from the one at the mean, so that angles do not jump between the points.
        middle = plant.output(k, np.ravel(ckf.x))[seen]

        def hx(x: Array) -> Array:
            return middle + residual(plant.output(k, x)[seen], middle)

        ckf.hx, ckf.sigmas_h = hx, np.zeros((2 * ckf.dim_x, int(seen.sum())))
        ckf.residual_z = lambda z, h: residual(z.T, h.T)[0][:, None]
        ckf.update(record.y[k, seen][:, None], R=np.diag(prior.R[seen]))
        y = np.ravel(ckf.y)
        return float(y @ ckf.SI @ y)

    return drive(ckf, model, record, predict, update)


class CKF(Estimator):
    """Cubature Kalman filter, filterpy's. Arasaratnam and Haykin (2009).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "ckf"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "white noise"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(cubature, model, record, q_scale)
