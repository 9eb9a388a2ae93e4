"""Recursive least squares of the coefficients of an effect, by the invariant-embedding filter of the model with it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from suite.following import follow
from suite.kernels.watch import MISFIT, age, learn
from suite.model import Model
from suite.record import Prior
from suite.streaming import Filter

Array = npt.NDArray[np.float64]

MEMORY = 200  # samples: how long the past counts where nothing else is said


class LeastSquares:
    """The coefficients as constant states of a filter that forgets: the past counts less by 1/e a `memory` (time).

    Where the model is linear an innovation is linear in the coefficients, so the update is recursive least squares of
    the innovations that the model without the effect would make (Friedland 1969); nothing is divided by a gain, so
    nothing is biased by one. Forgetting multiplies P by e^(dt/memory) a step that brings a measurement: everything is
    forgotten alike, else the state would go on to stand for the past. A parameter is never known less than at first.
    The band grows by what the effect leaves unexplained, as in least squares.

    `effect`: the model with the effect; `coefficients`: sd of each at first, by the parameter's name; `constant`: other
    parameters to follow that never forget. `prior` is for the model's own states. `fit` is what it knows beside the
    `filter`; the kernel `watched` takes samples with the two, as `add` does.
    """

    def __init__(
        self, effect: Model, prior: Prior, coefficients: Mapping[str, float], constant: Mapping[str, float],
        memory: float, channels: int,
    ) -> None:  # fmt: skip
        self.filter = Filter(*follow(effect, prior, {**constant, **coefficients}))
        x, P = self.filter.x, self.filter.P
        self._own, self._count = slice(len(x) - len(coefficients), len(x)), len(effect.states)
        # The largest variance of each: for parameters that at first; that of states grows with their size.
        most = P.diagonal()
        self.fit = np.concatenate([[memory, 1.0 / (MEMORY * channels), math.nan, 1.0], most, x, P.ravel()])

    def add(self, t: float, u: Array, y: Array) -> None:
        """Take the sample at time t, inputs u (inputs,), outputs y (outputs,), NaN where missing."""
        run = self.filter
        age(len(run.x), run.real, self.fit, self._count, t, y)
        run.add(t, u, y)
        learn(self.fit, run.innovation)

    @property
    def value(self) -> Array:
        """The coefficients now, (coefficients,)."""
        return self.filter.x[self._own].copy()

    @property
    def covariance(self) -> Array:
        """Their covariance, (coefficients, coefficients)."""
        return self.filter.P[self._own, self._own] * max(1.0, float(self.fit[MISFIT]))

    @property
    def sd(self) -> Array:
        """Their standard deviations, (coefficients,); a variance below zero by rounding is zero."""
        return np.sqrt(np.maximum(self.covariance.diagonal(), 0.0))
