"""The ensemble Kalman filter of filterpy."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from filterpy.kalman import EnsembleKalmanFilter

from baselines._filterpy import Array, Pass, Plant, Residual, Seen, alone, drive
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Numpy's global generator, which filterpy draws from, started from a seed and afterwards as it was."""
    before = np.random.get_state()
    np.random.seed(seed)
    try:
        yield
    finally:
        np.random.set_state(before)


def ensemble(model: Model, record: Record, prior: Prior, members: int = 30, inflation: float = 1.0) -> Pass:
    """Filterpy's EnsembleKalmanFilter (perturbed observations) over one run, from prior.x0 at the first sample.

    `inflation` multiplies the members' distances from their mean after each update. The draws are fixed by the
    readings: the same record gives the same answer, another seed of the benchmark another ensemble.
    """
    plant = Plant(model, record)
    with seeded(zlib.crc32(record.y.tobytes())):
        enkf: Any = EnsembleKalmanFilter(prior.x0.copy(), prior.P0.copy(), len(model.outputs), 1.0, members, None, None)

        def predict(k: int) -> None:
            enkf.Q, enkf.fx = np.diag(prior.Q * plant.dt(k)), lambda x, dt: plant.step(k, x)
            enkf.predict()

        def update(k: int, seen: Seen, residual: Residual) -> float:
            # The outputs are counted from the one at the mean, so that angles do not jump between the members.
            middle = plant.output(k, enkf.x)[seen]
            read: list[Array] = []

            def hx(x: Array) -> Array:
                read.append(middle + residual(plant.output(k, x)[seen], middle))
                return read[-1]

            # The perturbations have as many channels as are seen.
            enkf.hx, enkf._mean_z = hx, np.zeros(int(seen.sum()))
            z = middle + residual(record.y[k, seen], middle)
            enkf.update(z, R=np.diag(prior.R[seen]))
            y = z - np.mean(read, axis=0)
            if inflation != 1.0:
                enkf.sigmas = enkf.x + inflation * (enkf.sigmas - enkf.x)
                enkf.P = inflation**2 * enkf.P
            return float(y @ enkf.SI @ y)

        return drive(enkf, model, record, predict, update)


class EnKF(Estimator):
    """Ensemble Kalman filter with 30 members and perturbed observations, filterpy's. Evensen (1994), Burgers (1998).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "enkf"
    tuning = {"q_scale": (1e-4, 1e4, "log")}

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(ensemble, model, record, q_scale)
