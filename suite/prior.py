"""The prior that every estimator starts from: a record's own, or one made of the model and the record alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite.errors import DataError
from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]


def default_prior(model: Model, record: Record, noise: Array) -> Prior:
    """What may be known before the first sample; `noise` (outputs,) is the standard deviation of the sensors.

    x0: the known initial values with P0 = 0, else what the first sample says of a state measured directly, else zero,
    both with the variance of what is measured: the first sample is an estimator's to use, and must not count twice.
    R: the noise as given (never below 1e-6 of the output's spread).
    Q: (spread of the measured outputs' rate)^2 times the sampling step, for equations that may be wrong.
    """
    first = record.runs[0]
    seen = ~np.isnan(first.y)
    spread = np.array([np.std(first.y[seen[:, j], j]) if seen[:, j].any() else 0.0 for j in range(first.y.shape[1])])
    R = np.maximum(noise, 1e-6 * np.maximum(spread, 1e-300)) ** 2
    n = len(model.states)
    x0, P0 = np.zeros(n), np.zeros(n)
    for i, name in enumerate(model.states):
        given = model.initial.get(name)
        direct = [j for j, output in enumerate(model.outputs.values()) if output.equation.strip() == name]
        if given is not None and not given.estimate:
            x0[i] = given.value
        elif direct and seen[0, direct[0]]:
            x0[i], P0[i] = first.y[0, direct[0]], max(spread[direct[0]] ** 2, R[direct[0]])
        else:
            x0[i] = given.value if given is not None else 0.0
            P0[i] = float(np.max(spread**2))
    dt = float(np.median(first.dt))
    pace = max(_pace(first.t[seen[:, j]], first.y[seen[:, j], j]) for j in range(first.y.shape[1]))
    Q = np.array([pace**2 * dt if name in model.suspects else 0.0 for name in model.states])
    return Prior(x0, np.diag(P0), R, Q)


def _pace(t: Array, y: Array) -> float:
    """The root mean square of the rate of one output between the samples at which it was seen; 0 for fewer than two."""
    return float(np.sqrt(np.mean((np.diff(y) / np.diff(t)) ** 2))) if len(t) > 1 else 0.0


def prior_of(record: Record) -> Prior:
    """The record's prior; raises DataError where there is none."""
    if record.prior is None:
        raise DataError(
            f"{record.source}: the record has no prior; add one with record.with_prior(Prior(x0, P0, R, Q))"
        )
    return record.prior
