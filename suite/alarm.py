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

GROWTH = 1.5
# Beyond so many sd an innovation counts as this: one outlier is no failing model.
CLIP = 3.0
A, B = 0.5 * (1.0 - GROWTH**-2), math.log(GROWTH)
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
    """

    def __init__(self, rate: float, channels: int) -> None:
        self.limit = limit_for(channels / rate)
        self.started: float | None = None
        self.since: float | None = None
        self.reset()

    def reset(self) -> None:
        """Know of nothing."""
        self.g, self.started, self.since = 0.0, None, None

    @property
    def statistic(self) -> float:
        """The sum over its limit: 1 raises the alarm."""
        return self.g / self.limit

    def add(self, t: float, innovations: npt.NDArray[np.float64]) -> None:
        """The innovations (channels,) of one sample over their sd; NaN was not measured, infinite is a lost filter."""
        for e in innovations.tolist():
            if math.isnan(e):
                continue
            g = min(self.g + A * min(e * e, CLIP**2) - B, self.limit)
            if g <= 0.0:
                self.reset()
                continue
            self.g = g
            if self.started is None:
                self.started = t
            if g >= self.limit:
                self.since = self.started
