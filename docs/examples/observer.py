"""A filter with a constant gain."""

import numpy as np

from suite.estimator import Estimate, Estimator
from suite.prior import prior_of


class Observer(Estimator):
    """Observer with a constant gain. Luenberger (1964); d is its correction over the step."""

    name = "observer"
    tuning = {"gain": (0.01, 1.0, "log")}

    def estimate(self, model, record, gain=0.3):
        N, n = len(record), len(model.states)
        xs, d, x = np.zeros((N, n)), np.zeros((N, n)), prior_of(record).x0.copy()
        for k in range(N):
            t, u = float(record.t[k]), tuple(record.u[k])
            dt = float(record.t[max(k, 1)] - record.t[max(k, 1) - 1])
            if k > 0:
                x = model.step(float(record.t[k - 1]), x, tuple(record.u[k - 1]), dt, u)
            seen = ~np.isnan(record.y[k])
            H = model.output_jacobian(t, x, u)[seen]
            shift = gain * np.linalg.pinv(H) @ (record.y[k] - model.output(t, x, u))[seen]
            x = x + shift
            xs[k], d[k] = x, shift / dt
        return Estimate(x=xs, d=d)
