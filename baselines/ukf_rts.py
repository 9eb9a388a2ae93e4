"""The unscented smoother of filterpy behind its unscented Kalman filter."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from baselines._filterpy import Array, Pass, Plant, alone, smoothed_pass, unscented, unscented_filter
from baselines.ekf_rts import inverse
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Prior, Record


def unscented_smoother(model: Model, record: Record, prior: Prior) -> Pass:
    """Filterpy's UKF over one run, then its rts_smoother.

    filterpy 2.0 hands the plant's function no time but a step's length, and does not use its argument Qs: the length
    is here the number of the step, and the function sets Q before filterpy reads it.
    """
    run, plant = unscented(model, record, prior), Plant(model, record)

    def smooth(last: int) -> tuple[Array, Array]:
        ukf: Any = unscented_filter(model)
        ukf.inv = inverse

        def fx(x: Array, k: int) -> Array:
            ukf.Q = np.diag(prior.Q * plant.dt(k))
            return plant.step(k, x)

        ukf.fx = fx
        x, P, _ = ukf.rts_smoother(run.x[:last], run.P[:last], dts=range(1, last + 1))
        return x, P

    return smoothed_pass(run, plant, smooth)


class UKFSmoother(Estimator):
    """Unscented Kalman filter and RTS smoother, filterpy's. Sarkka (2008).

    Process noise is q_scale Q dt a step, Q the prior's density; d is the smoothed jump of each step as a rate.
    """

    name = "ukf-rts"
    kind: ClassVar[Literal["filter", "smoother"]] = "smoother"
    tuning = {"q_scale": (1e-4, 1e4, "log")}
    optimal = "white noise"

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0) -> Estimate:
        return alone(unscented_smoother, model, record, q_scale)
