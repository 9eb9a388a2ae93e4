"""Recursive least squares of the coefficients of an effect, by the invariant-embedding filter of the model with it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from suite.following import follow
from suite.kernels.watch import forget
from suite.model import Model
from suite.record import Prior
from suite.streaming import Filter, deviations

Array = npt.NDArray[np.float64]

MEMORY = 200  # samples: how long the past counts where nothing else is said
SPREAD = 10.0  # a state that nothing measures is not known better than its size, and not worse than so many times that


class LeastSquares:
    """The coefficients as constant states of a filter that forgets: the past counts less by 1/e a `memory` (time).

    Where the model is linear an innovation is linear in the coefficients, so the update is recursive least squares of
    the innovations that the model without the effect would make (Friedland 1969); nothing is divided by a gain, so
    nothing is biased by one. Forgetting multiplies P by e^(dt/memory) a step that brings a measurement: everything is
    forgotten alike, else the state would go on to stand for the past. A parameter is never known less than at first.
    The band grows by what the effect leaves unexplained, as in least squares.

    `effect`: the model with the effect; `coefficients`: sd of each at first, by the parameter's name; `constant`: other
    parameters to follow that never forget. `prior` is for the model's own states.
    """

    def __init__(
        self, effect: Model, prior: Prior, coefficients: Mapping[str, float], constant: Mapping[str, float],
        memory: float, channels: int,
    ) -> None:  # fmt: skip
        self.filter = Filter(*follow(effect, prior, {**constant, **coefficients}))
        n = len(self.filter.x)
        self._own, self._count = slice(n - len(coefficients), n), len(effect.states)
        # The largest variance of each: for parameters that at first; that of states grows with their size.
        self._most = self.filter.P.diagonal().copy()
        self._first = (self.filter.x.copy(), self.filter.P.copy())
        self._memory, self._share, self._t = memory, 1.0 / (MEMORY * channels), math.nan
        self._misfit = 1.0

    def add(self, t: float, u: Array, y: Array) -> None:
        """Take the sample at time t, inputs u (inputs,), outputs y (outputs,), NaN where missing."""
        run = self.filter
        if t > self._t and any(e == e for e in y.tolist()):
            forget(math.exp((t - self._t) / self._memory), self._most, self._count, SPREAD, run.x, run.P)
        self._t = t
        run.add(t, u, y)
        for e in run.innovation.tolist():
            if math.isfinite(e):
                self._misfit += self._share * (e * e - self._misfit)

    def restart(self, x: Array, P: Array) -> None:
        """Know of the parameters what was known at first, of the model's states x (n,) with covariance P (n, n)."""
        states = slice(0, self._count)
        self.filter.x[:], self.filter.P[:] = self._first
        self.filter.x[states], self.filter.P[states, states] = x, P
        self._misfit = 1.0

    @property
    def value(self) -> Array:
        """The coefficients now, (coefficients,)."""
        return self.filter.x[self._own].copy()

    @property
    def covariance(self) -> Array:
        """Their covariance, (coefficients, coefficients)."""
        return self.filter.P[self._own, self._own] * max(1.0, self._misfit)

    @property
    def sd(self) -> Array:
        """Their standard deviations, (coefficients,)."""
        return deviations(self.filter.P, self._own) * math.sqrt(max(1.0, self._misfit))
