"""Recursive least squares of the coefficients of an effect, by the invariant-embedding filter of the model with it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from suite.following import follow
from suite.model import Model
from suite.record import Prior
from suite.streaming import Filter

MEMORY = 200  # samples: how long the past counts where nothing else is said


class LeastSquares:
    """The coefficients as constant states of a filter that forgets: the past counts less by 1/e a `memory` (time).

    Where the model is linear an innovation is linear in the coefficients, so the update is recursive least squares of
    the innovations that the model without the effect would make (Friedland 1969); nothing is divided by a gain, so
    nothing is biased by one. Forgetting multiplies P by e^(dt/memory) a step that brings a measurement: everything is
    forgotten alike, else the state would go on to stand for the past. A parameter is never known less than at first.
    The band grows by what the effect leaves unexplained, as in least squares.

    `effect`: the model with the effect; `coefficients`: sd of each at first, by the parameter's name; `constant`: other
    parameters to follow that never forget. `prior` is for the model's own states. The kernel `watched` takes a sample
    with `filter` and `fit`, in which it keeps what it knows beside.
    """

    def __init__(
        self, effect: Model, prior: Prior, coefficients: Mapping[str, float], constant: Mapping[str, float],
        memory: float, channels: int,
    ) -> None:  # fmt: skip
        self.filter = Filter(*follow(effect, prior, {**constant, **coefficients}))
        x, P = self.filter.x, self.filter.P
        # The largest variance of each: for parameters that at first; that of states grows with their size.
        most = P.diagonal()
        self.fit = np.concatenate([[memory, 1.0 / (MEMORY * channels), math.nan, 1.0], most, x, P.ravel()])
