"""The interacting multiple-model estimator of filterpy over two extended Kalman filters."""

from __future__ import annotations

from typing import Any

import numpy as np
from filterpy.kalman import IMMEstimator

from baselines._filterpy import Array, Pass, Plant, Residual, Seen, SteppedEKF, alone, drive
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record

# The two hypotheses of a user who knows that the model fails now and then: it holds (a hundredth of the process
# noise), or it does not (all of it); a hypothesis lasts 20 samples on average.
SHARES = (0.01, 1.0)
STAY = 0.95


class _Mode(SteppedEKF):
    """One of the filters, called by filterpy's IMMEstimator; the sample that it works on is set from outside."""

    def __init__(self, plant: Plant, prior: Prior, share: float) -> None:
        super().__init__(len(plant.model.states), len(plant.model.outputs))
        self.plant, self.density, self.variance, self.k = plant, share * prior.Q, prior.R, 0
        self.x, self.P = prior.x0.copy(), prior.P0.copy()
        self.seen: Seen = np.zeros(0, dtype=np.bool_)
        self.residual: Residual = np.subtract

    def predict(self, u: Any = 0) -> None:
        self.moved, self.F = self.plant.transition(self.k, self.x)
        self.Q = np.diag(self.density * self.plant.dt(self.k))
        super().predict()

    def update(self, z: Array | None, *rest: Any, **named: Any) -> None:
        k, seen, self.z = self.k, self.seen, z
        if z is not None:
            super().update(
                z,
                lambda x: self.plant.output_jacobian(k, x)[seen],
                lambda x: self.plant.output(k, x)[seen],
                R=np.diag(self.variance[seen]),
                residual=self.residual,
            )

    @property
    def likelihood(self) -> float:
        """Of the last measurement; where there was none the modes are told apart by nothing."""
        return 1.0 if self.z is None else float(super().likelihood)


def interacting(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's IMMEstimator over one run, from prior.x0 at the first sample, which is used too."""
    plant = Plant(model, record)
    modes = [_Mode(plant, prior, share) for share in SHARES]
    imm = IMMEstimator(modes, [0.5, 0.5], np.array([[STAY, 1.0 - STAY], [1.0 - STAY, STAY]]))

    def predict(k: int) -> None:
        for mode in modes:
            mode.k = k
        imm.predict()

    def update(k: int, seen: Seen, residual: Residual) -> float:
        H, x = plant.output_jacobian(k, imm.x)[seen], imm.x.copy()
        S, e = H @ imm.P @ H.T + np.diag(prior.R[seen]), residual(record.y[k, seen], plant.output(k, x)[seen])
        for mode in modes:
            mode.seen, mode.residual = seen, residual
        imm.update(record.y[k, seen])
        return float(e @ np.linalg.solve(S, e))

    return drive(imm, model, record, predict, update, missed=lambda: imm.update(None))


class IMM(Estimator):
    """Interacting multiple models, filterpy's: the model holds, or it fails. Blom and Bar-Shalom (1988).

    Process noise is q_scale Q dt a step where the model fails and a hundredth of it where it holds, Q the prior's
    density; d is the jump of each sample as a rate (see `alone`).
    """

    name = "imm"
    tuning = {"q_scale": (1e-4, 1e4, "log")}

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(interacting, model, record, q_scale)
