"""The exact answer on a linear plant with Gaussian noise, by conditioning one dense normal distribution.

No recursion of Kalman's is used: all states of all samples are one Gaussian vector, and what was measured is given.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import scipy.linalg

from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# How the noise of a step is reckoned: its exact covariance, or its density times the step added at the end of the
# step, or half at each end. All three are in use; they differ in the first order of the step.
Form = Literal["exact", "at the end", "at both ends"]
FORMS: tuple[Form, ...] = get_args(Form)


@dataclass(frozen=True)
class Path:
    """All states at all samples before anything is measured: mean (N, n), covariance (N n, N n); H (outputs, n)."""

    mean: Array
    covariance: Array
    H: Array

    @cached_property
    def root(self) -> Array:
        """A square root of the covariance, (N n, N n), which is singular where the first state or a step is certain."""
        values, vectors = np.linalg.eigh(self.covariance)
        root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
        return root

    def drawn(self, rng: np.random.Generator) -> Array:
        """One realisation, (N, n)."""
        offset: Array = np.reshape(self.root @ rng.standard_normal(len(self.root)), self.mean.shape)
        return self.mean + offset

    def given(self, y: Array, R: Array, *, causal: bool) -> tuple[Array, Array]:
        """Mean (N, n) and covariance (N, n, n) given the measurements up to each sample, or (not causal) all."""
        N, n = self.mean.shape
        x, P = np.zeros((N, n)), np.zeros((N, n, n))
        for k in range(N):
            seen = ~np.isnan(y)
            if causal:
                seen[k + 1 :] = False
            samples, channels = np.nonzero(seen)
            C = np.zeros((len(samples), N * n))
            for row, (i, j) in enumerate(zip(samples, channels, strict=True)):
                C[row, i * n : (i + 1) * n] = self.H[j]
            own = slice(k * n, (k + 1) * n)
            across = self.covariance[own] @ C.T
            gain = np.linalg.solve(C @ self.covariance @ C.T + np.diag(R[channels]), across.T).T
            x[k] = self.mean[k] + gain @ (y[seen] - C @ self.mean.ravel())
            P[k] = self.covariance[own, own] - gain @ across.T
        return x, P


def path(model: Model, record: Record, prior: Prior, form: Form) -> Path:
    """The states of a linear model with held inputs over a run, before anything is measured."""
    N, n = len(record), len(model.states)
    zero, idle = np.zeros(n), np.zeros(len(model.inputs))
    A, H = model.jacobian(0.0, zero, tuple(idle)), model.output_jacobian(0.0, zero, tuple(idle))
    drift = model.rate(0.0, zero, tuple(idle))
    B = np.column_stack([model.rate(0.0, zero, tuple(row)) - drift for row in np.eye(len(idle))] or [np.zeros((n, 0))])
    mean = np.zeros((N, n))
    mean[0] = prior.x0
    # Row k of blocks is what the first state and the noise of each step make of the state at sample k.
    effect = np.zeros((N * n, N * n))
    noise = np.zeros((N * n, N * n))
    effect[:n, :n], noise[:n, :n] = np.eye(n), prior.P0
    for k in range(1, N):
        dt = float(record.t[k] - record.t[k - 1])
        now, before = slice(k * n, (k + 1) * n), slice((k - 1) * n, k * n)
        Phi, push = _step(A, drift + B @ record.u[k - 1], dt)
        mean[k] = Phi @ mean[k - 1] + push
        effect[now] = Phi @ effect[before]
        effect[now, now] = np.eye(n)
        noise[now, now] = step_noise(A, np.diag(prior.Q), dt, form)
    return Path(mean, effect @ noise @ effect.T, H)


def _step(A: Array, forcing: Array, dt: float) -> tuple[Array, Array]:
    """e^(A dt), and the integral of e^(A s) over the step times a constant forcing."""
    n = len(A)
    grown = np.zeros((n + 1, n + 1))
    grown[:n, :n], grown[:n, n] = A, forcing
    whole = np.asarray(scipy.linalg.expm(grown * dt))
    return whole[:n, :n], whole[:n, n]


def step_noise(A: Array, Q: Array, dt: float, form: Form) -> Array:
    """The covariance (n, n) of a step's process noise of density Q; the exact one by Van Loan (1978)."""
    n = len(A)
    if form == "exact":
        whole = scipy.linalg.expm(np.block([[-A, Q], [np.zeros((n, n)), A.T]]) * dt)
        return np.asarray(whole[n:, n:].T @ whole[:n, n:])
    if form == "at the end":
        return Q * dt
    Phi = scipy.linalg.expm(A * dt)
    return np.asarray(0.5 * dt * (Q + Phi @ Q @ Phi.T))
