"""The extended Kalman filter, which is discrete invariant embedding with P = 2S, fed one sample at a time."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from suite.kernels.types import arrays
from suite.kernels.watch import next_sample
from suite.model import Model
from suite.record import Prior

Array = npt.NDArray[np.float64]


class Filter:
    """`filtered` with noise spread over the steps, a sample at a time: the same kernel, the same numbers.

    x (n,), P (n, n): the estimate after the last sample, written in place; innovation (outputs,): the last innovations
    over their sd, NaN where missing. `lost`: a number was no longer finite; x and P are then those before, and the
    innovations infinite.
    """

    def __init__(self, model: Model, prior: Prior) -> None:
        program, m = model.program, len(model.outputs)
        self.x, self.P = np.array(prior.x0, dtype=np.float64), np.array(prior.P0, dtype=np.float64)
        self.innovation, self.lost = np.full(m, np.nan), False
        # An address costs a tenth of a microsecond to hand over, a function sixteen; the program owns both.
        self._program = program
        Q, R, angle = arrays(np.diag(prior.Q), prior.R, model.angles)
        addresses = program.rate.address, program.output.address
        last = np.full(2, np.nan), np.zeros((2, program.inputs)), np.full((2, m), np.nan)
        parts = (*last[:2], model.linear_inputs, last[2], self.x, self.P, model.values, program.all_off())
        self._fixed = (*addresses, *parts, Q, R, angle)

    def add(self, t: float, u: Array, y: Array) -> None:
        """Take the sample at time t: u (inputs,), y (outputs,) with NaN where missing. The first updates x0, P0."""
        if self.lost:
            self.innovation[:] = np.where(np.isnan(y), np.nan, np.inf)
            return
        rate, output, *fixed = self._fixed
        self.lost = next_sample(rate, output, t, u, y, *fixed, self.innovation) == 0


def deviations(P: Array, own: slice) -> Array:
    """Standard deviations of some states with covariance P (n, n); a variance below zero by rounding is zero."""
    return np.array([math.sqrt(max(P[i, i], 0.0)) for i in range(own.start, own.stop)])
