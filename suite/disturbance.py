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
    variance, pace = _size_and_pace(model, record, prior)
    walk = q_scale * SHARE * variance * pace
    return model.with_disturbance(model.suspects), _grown(model, prior, variance, walk)


def with_integrated_walk(model: Model, record: Record, prior: Prior, q_scale: float) -> tuple[Model, Prior]:
    """The model with states d_<name> and d_d_<name> for each suspect, and the prior for all.

    d' = slope, slope' = white noise: an integrated random walk, whose d is smooth. v and T as in `with_random_walk`.
    A smooth d changes by swinging, CHANGES times over the record: w = 2 pi CHANGES / T. d starts from 0 with variance
    v, its slope from 0 with variance v w^2. A density q gives d the variance q s^3 / 3 in a time s;
    q = q_scale 3 SHARE v w^3 makes that SHARE v after 1 / w.
    """
    variance, changes = _size_and_pace(model, record, prior)
    pace = 2.0 * np.pi * changes
    walk = q_scale * 3.0 * SHARE * variance * pace**3
    start = np.concatenate([variance, variance * pace**2])
    driven = model.with_disturbance(model.suspects)
    sloped = driven.with_disturbance([f"d_{name}" for name in model.suspects])
    return sloped, _grown(model, prior, start, np.concatenate([np.zeros_like(walk), walk]))


def spread_out(model: Model, values: Array, covariance: Array | None = None) -> tuple[Array, Array | None]:
    """The disturbance states of a grown model (N, n + m or n + 2 m) as d (N, n), and their covariance as (N, n, n).

    Equations that are not suspected have d = 0 with covariance 0.
    """
    at = _suspected(model)
    n, N = len(model.states), len(values)
    own = slice(n, n + len(at))
    d = np.zeros((N, n))
    d[:, at] = values[:, own]
    if covariance is None:
        return d, None
    P_d = np.zeros((N, n, n))
    P_d[:, at[:, None], at[None, :]] = covariance[:, own, own]
    return d, P_d


def _suspected(model: Model) -> npt.NDArray[np.int64]:
    """Where the suspects are among the states, (m,)."""
    names = list(model.states)
    return np.array([names.index(name) for name in model.suspects], dtype=np.int64)


def _size_and_pace(model: Model, record: Record, prior: Prior) -> tuple[Array, float]:
    """The variance v (m,) of each suspect's model error, and how often it changes by its size in a unit of time."""
    variance = prior.Q[_suspected(model)] / float(np.median(record.dt))
    return variance, CHANGES / float(record.t[-1] - record.t[0])


def _grown(model: Model, prior: Prior, variance: Array, density: Array) -> Prior:
    """The prior with further states that start from 0 with `variance` and have process noise of `density`."""
    n, more = len(model.states), len(variance)
    P0 = np.zeros((n + more, n + more))
    P0[:n, :n] = prior.P0
    P0[n:, n:] = np.diag(variance)
    # Noise in an equation that the prior lets err but that is no suspect stays.
    Q = prior.Q.copy()
    Q[_suspected(model)] = 0.0
    return Prior(np.concatenate([prior.x0, np.zeros(more)]), P0, prior.R, np.concatenate([Q, density]))
