"""Smoothing and differentiation of the measurements by local polynomials, without a filter."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.prior import prior_of
from suite.readings import derivative_of, read_by, readings
from suite.record import Record

Array = npt.NDArray[np.float64]


class SavitzkyGolay(Estimator):
    """Least-squares cubics over a sliding window, scipy's savgol_filter. Savitzky and Golay (1964).

    A measured state is the smoothed reading, the rate v of a state p (p' = v) that is not measured its derivative, and
    d is x' - f(x) in the suspected equations, to be regressed by least squares. `window` is its length in samples.
    Gaps are bridged and irregular steps made even by straight lines.
    """

    name = "savitzky-golay"
    kind: ClassVar[Literal["filter", "smoother"]] = "smoother"
    tuning = {"window": (5.0, 61.0, "log")}

    def skip(self, model: Model, record: Record) -> str | None:
        """Every state must be measured or the rate of one that is; half the readings must be there."""
        read, by_rate = read_by(model), derivative_of(model)
        for name in model.states:
            if name not in read and by_rate.get(name) not in read:
                return f"{name} is neither measured nor the rate of a measured state"
        few = [
            o for o, y in zip(model.outputs, record.y.T, strict=True) if o in read.values() and np.isnan(y).mean() > 0.5
        ]
        if few:
            return f"of {few[0]} more than half the readings are missing: polynomials need them closer together"
        return "a cubic needs at least 5 samples" if len(record) < 5 else None

    def estimate(self, model: Model, record: Record, window: float = 15.0) -> Estimate:
        prior_of(record)  # not used, but every estimator says so where it is missing
        N, n = len(record), len(model.states)
        reason = self.skip(model, record)
        if reason is not None:
            return Estimate(x=np.zeros((N, n)), d=np.zeros((N, n)), status="diverged", note=reason)
        length = min(2 * round((window - 1) / 2) + 1, N - 1 + N % 2)
        even = np.linspace(record.t[0], record.t[-1], N)
        read, by_rate = readings(model, record), derivative_of(model)
        x, slope = np.zeros((N, n)), np.zeros((N, n))
        for i, name in enumerate(model.states):
            source, order = (name, 0) if name in read else (by_rate[name], 1)
            seen = ~np.isnan(read[source])
            y = np.interp(even, record.t[seen], read[source][seen])
            for values, deriv in ((x, order), (slope, order + 1)):
                smooth = savgol_filter(y, length, 3, deriv=deriv, delta=float(even[1] - even[0]))
                values[:, i] = np.interp(record.t, even, smooth)
        f = np.array([model.rate(t, state, u) for t, state, u in zip(record.t, x, record.u, strict=True)])
        suspected = np.array([name in model.suspects for name in model.states])
        return Estimate(x=x, d=np.where(suspected, slope - f, 0.0))
