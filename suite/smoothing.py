"""The fixed-interval smoother of a filter pass: states, and the noise that the steps must have had."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from suite.filtering import Filtered
from suite.kernels.ahead import ahead
from suite.kernels.factored import WIDE
from suite.kernels.smoother import adjoint, adjoint_workspace
from suite.kernels.types import arrays

Array = npt.NDArray[np.float64]

LOST = 1e-6  # what is left of a variance where P - P Lambda P has lost its digits
FAR = 1e14  # a forecast's variance over its sensor's where the means have lost theirs


@dataclass(frozen=True)
class Smoothed:
    """A smoothed run: x (N, n), P (N, n, n); before, after (N, n) the adjoint ahead of and behind each measurement,
    Before (N, n, n) the information ahead of it.

    The process noise of the step that ends at a sample is Qd before, its covariance Qd - Qd Before Qd.
    """

    x: Array
    P: Array
    before: Array
    Before: Array
    after: Array


def smoothed(run: Filtered) -> Smoothed:
    """The fixed-interval smoother of a filter pass that did not fail."""
    N, n = run.x.shape
    Xs, before, after = (np.zeros((N, n)) for _ in range(3))
    Ps, Before, After = (np.zeros((N, n, n)) for _ in range(3))
    work = adjoint_workspace(n)
    adjoint(
        run.Phi, run.H, run.K, run.innovation, run.variance, run.x, run.P, work, Xs, Ps, before, Before, after, After
    )  # fmt: skip
    asked = _lost(run, Ps)
    if asked.any():
        room = (*np.zeros((4, n)), *np.zeros((4, n, n)))
        x, l, m = Xs.copy(), before.copy(), after.copy()
        L = Before.copy()
        ahead(
            run.Phi, run.Qd, run.H, run.K, run.innovation, run.seen, *arrays(run.R), run.x, run.x_prior, run.P, asked,
            room, x, Ps, l, L, m,
        )  # fmt: skip
        # The adjoint keeps the means to a hundredth of their deviations up to here, and the better the wider the noise.
        far = _last(run, FAR)
        Xs[:far], after[:far], before[: far + 1], Before[: far + 1] = x[:far], m[:far], l[: far + 1], L[: far + 1]
    return Smoothed(Xs, Ps, before, Before, after)


def _last(run: Filtered, ratio: float) -> int:
    """How many samples there are up to the last one whose forecast was so many times as uncertain as is usual.

    Where the noise of the steps makes every forecast wide, none of them is: what comes after says little of a state.
    """
    channels = zip(run.variance.T, run.seen.T, strict=True)
    usual = np.array([np.median(variance[seen]) if seen.any() else np.inf for variance, seen in channels])
    rows = np.flatnonzero((run.seen & (run.variance > ratio * usual)).any(axis=1))
    return int(rows.max(initial=-1)) + 1


def _lost(run: Filtered, Ps: Array) -> npt.NDArray[np.bool_]:
    """The samples (N,) of which P - P Lambda P, Ps (N, n, n), cannot be trusted.

    Those up to the last one at which the state was unknown beside the sensor, and those whose difference is too small.
    """
    variances, left = (np.diagonal(matrices, axis1=1, axis2=2) for matrices in (run.P, Ps))
    lost = np.array(((left < LOST * variances) | (left > (1.0 + LOST) * variances)).any(axis=1))
    lost[: _last(run, WIDE)] = True
    return lost
