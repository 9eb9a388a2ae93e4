"""A model whose suspected equations carry a random-walk disturbance, and the prior that belongs to it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# Where nothing else is known: the model error has this share of the rates' variance, and changes by its own size so
# many times over a record.
SHARE, CHANGES = 0.1, 3.0


def with_random_walk(model: Model, record: Record, prior: Prior, q_scale: float) -> tuple[Model, Prior]:
    """The model with a state d_<name> for each suspect, and the prior for both.

    The prior's density Q says how large a model error may be: v = Q / dt is its variance when it changes from sample
    to sample. The walk starts from 0 with variance v and has density q_scale SHARE v CHANGES / T, T the record's
    length. The original equations keep no other noise: what they lack, the disturbance holds.
    """
    names = list(model.states)
    at = np.array([names.index(name) for name in model.suspects], dtype=np.int64)
    n, m = len(names), len(at)
    dt = float(np.median(record.dt))
    variance = prior.Q[at] / dt
    walk = q_scale * SHARE * variance * CHANGES / float(record.t[-1] - record.t[0])
    P0 = np.zeros((n + m, n + m))
    P0[:n, :n] = prior.P0
    P0[n:, n:] = np.diag(variance)
    # Noise in an equation that the prior lets err but that is no suspect stays.
    Q = prior.Q.copy()
    Q[at] = 0.0
    grown = Prior(np.concatenate([prior.x0, np.zeros(m)]), P0, prior.R, np.concatenate([Q, walk]))
    return model.with_disturbance(model.suspects), grown


def spread_out(model: Model, values: Array, covariance: Array | None = None) -> tuple[Array, Array | None]:
    """The disturbance states of a grown model (N, n + m) as d (N, n), and their covariance as (N, n, n).

    Equations that are not suspected have d = 0 with covariance 0.
    """
    names = list(model.states)
    at = np.array([names.index(name) for name in model.suspects], dtype=np.int64)
    n, N = len(names), len(values)
    d = np.zeros((N, n))
    d[:, at] = values[:, n:]
    if covariance is None:
        return d, None
    P_d = np.zeros((N, n, n))
    P_d[:, at[:, None], at[None, :]] = covariance[:, n:, n:]
    return d, P_d
