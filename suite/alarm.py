"""A sequential test, with a stated rate of false alarms, of whether a model is still as good as its filter says.

A cumulative sum of log-likelihood ratios (Page 1954) of innovations whose standard deviation grew by GROWTH:
    g = max(0, g + A min(e^2, CLIP^2) - B),   e the innovation over its sd,  A = (1 - GROWTH^-2)/2,  B = ln GROWTH
It needs no idea of what goes wrong: whatever the model lacks makes the innovations larger than they should be.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.special import erf

from suite.kernels.watch import CLIP, SINCE, A, B, cusum

CELLS = 100


def run_length(limit: float) -> float:
    """Mean number of innovations until g reaches the limit while the model is right, from g = 0.

    g is a Markov chain while e is standard normal; L = 1 + Q L on a grid of its values (Brook and Evans 1972).
    """
    width = limit / CELLS
    places = np.concatenate([[0.0], (np.arange(CELLS) + 0.5) * width])
    edges = np.concatenate([[0.0], np.arange(1, CELLS + 1) * width])
    below = _step_below(edges[None, :] - places[:, None])
    Q = np.diff(below, axis=1, prepend=0.0)
    return float(np.linalg.solve(np.eye(CELLS + 1) - Q, np.ones(CELLS + 1))[0])


def _step_below(z: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Probability that a step of g is at most z."""
    return np.where(z >= A * CLIP**2 - B, 1.0, erf(np.sqrt(np.maximum((z + B) / A, 0.0) / 2.0)))


@cache
def limit_for(length: float) -> float:
    """The limit whose mean run length without a failure is `length` innovations (2 at least)."""
    high = 1.0
    while run_length(high) < length:
        high += 2.0
    return float(brentq(lambda limit: math.log(run_length(limit) / length), 1e-3, high, xtol=1e-3))


class Alarm:
    """The test, sample by sample. `since` is the time from which on the model has failed, None while it has not.

    `rate`: false alarms a sample, while `channels` innovations a sample come. An alarm ends when the sum is back at 0.
    `test` is all that the kernel takes: the limit, the sum, and its two times.
    """

    def __init__(self, rate: float, channels: int) -> None:
        self.test = np.array([limit_for(channels / rate), 0.0, np.nan, np.nan])

    @property
    def since(self) -> float | None:
        """The time from which on the model has failed."""
        return None if math.isnan(self.test[SINCE]) else float(self.test[SINCE])

    def add(self, t: float, innovations: npt.NDArray[np.float64]) -> None:
        """The innovations (channels,) of one sample over their sd; NaN was not measured, infinite is a lost filter."""
        cusum(self.test, t, innovations)
