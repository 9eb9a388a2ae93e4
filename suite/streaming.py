"""The extended Kalman filter, which is discrete invariant embedding with P = 2S, fed one sample at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite.kernels.streaming import LOST, next_sample, packed
from suite.kernels.types import arrays
from suite.model import Model
from suite.record import Prior

Array = npt.NDArray[np.float64]


class Filter:
    """`filtered` with noise spread over the steps, a sample at a time: the same kernel, the same numbers.

    x (n,), P (n, n): the estimate after the last sample, written in place; innovation (outputs,): the last innovations
    over their sd, NaN where missing. They are views of `real`, which with `whole` is all that the kernel takes.
    """

    def __init__(self, model: Model, prior: Prior) -> None:
        program, n, m = model.program, len(prior.x0), len(model.outputs)
        given = arrays(prior.x0, prior.P0, model.linear_inputs, model.values, np.diag(prior.Q), prior.R, model.angles)
        # An address costs a tenth of a microsecond to hand over, a function sixteen; the program owns both.
        self._program = program
        off = program.all_off()
        addresses = program.step_when(off), program.rate.address, program.output.address
        self.whole, self.real = packed(addresses, off, *given)
        self.x, self.P = self.real[:n], self.real[n : n + n * n].reshape(n, n)
        self.innovation = self.real[n + n * n : n + n * n + m]

    @property
    def lost(self) -> bool:
        """A number was no longer finite; x and P are those before, and the innovations infinite."""
        return bool(self.whole[LOST])

    def add(self, t: float, u: Array, y: Array) -> None:
        """Take the sample at time t: u (inputs,), y (outputs,) with NaN where missing. The first updates x0, P0."""
        next_sample(self.whole, self.real, t, u, y)
