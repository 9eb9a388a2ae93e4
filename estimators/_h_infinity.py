"""The central H-infinity filter as a compiled pass, and the least gamma for which it exists over a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import WORK, advance, workspace
from suite.kernels.types import arrays
from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# Above this gamma the filter is the Kalman filter to all digits; the search for the least one ends here.
HIGHEST = 1e9
FOUND = 1e-3
LOST, LEFT_BOUNDS, NO_FILTER = 1e100, 1, 2

# x, base, g (n,); yv (outputs,); T, M, B (n, n); Hx (outputs, n), Hp (outputs, parameters)
H_INFINITY_WORK = nb.types.Tuple((nb.VECTOR,) * 4 + (nb.MATRIX,) * 5)


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.INDICES,
        nb.INDICES, nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.REAL, WORK, H_INFINITY_WORK,
        nb.MATRIX, nb.CUBE, nb.MATRIX, nb.INDICES,
    )
)  # fmt: skip
def central_pass(
    rate: Any, output: Any, t: Any, u: Any, linear: Any, y: Any, x0: Any, P0: Any, p: Any, on: Any,
    none: Any, Q: Any, R: Any, angle: Any, L: Any, gamma: float, advance_work: Any, work: Any,
    X: Any, P: Any, jump: Any, info: Any,
) -> None:  # fmt: skip
    """M = [P^-1 + H' R^-1 H]^-1,  x+ = x + M H' R^-1 (y - h(x)),  P(k+1) = F [M^-1 - gamma^-2 L'L]^-1 F' + Q dt.

    It exists while M^-1 - gamma^-2 L'L > 0; then each row l of L is a measurement of variance -gamma^2:
    gamma^2 - l M l' > 0, M += M l' l M / (gamma^2 - l M l'), which needs no inverse and allows a singular M.
    Q (n, n) density, R (outputs,) variance of a sample, L (rows, n). Writes X, jump (N, n), P (N, n, n): M, info (2,):
    -1, or the sample at which the pass ended and why (LEFT_BOUNDS, NO_FILTER: nothing is written from there on).
    """
    x, base, g, yv, T, M, B, Hx, Hp = work
    n = x0.shape[0]
    info[0], info[1] = -1, 0
    for i in range(n):
        x[i] = x0[i]
        for j in range(n):
            M[i, j] = P0[i, j]
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            advance(rate, t[k - 1], dt, u[k - 1], u[k], linear, p, on, none, 1, x, T, advance_work)
            for i in range(n):
                for j in range(n):
                    B[i, j] = 0.0
                    for l in range(n):
                        B[i, j] += T[i, l] * M[l, j]
            for i in range(n):
                for j in range(i + 1):
                    total = Q[i, j] * dt
                    for l in range(n):
                        total += B[i, l] * T[j, l]
                    M[i, j] = total
                    M[j, i] = total
        for i in range(n):
            base[i] = x[i]
        output(t[k], base, u[k], p, on, yv, Hx, Hp)
        for c in range(y.shape[1]):
            if math.isnan(y[k, c]):
                continue
            e = y[k, c] - yv[c]
            if angle[c] > 0.0:
                e = math.atan2(math.sin(e), math.cos(e))
            variance = R[c]
            for i in range(n):
                e -= Hx[c, i] * (x[i] - base[i])
                g[i] = 0.0
                for j in range(n):
                    g[i] += M[i, j] * Hx[c, j]
                variance += Hx[c, i] * g[i]
            for i in range(n):
                x[i] += g[i] / variance * e
                for j in range(n):
                    M[i, j] -= g[i] * g[j] / variance
        for i in range(n):
            if not abs(x[i]) < LOST or not abs(M[i, i]) < LOST:
                info[0], info[1] = k, LEFT_BOUNDS
                return
            # What is written is M before gamma enters; it is taken back below where gamma allows no filter.
            X[k, i] = x[i]
            jump[k, i] = x[i] - base[i]
            for j in range(n):
                P[k, i, j] = M[i, j]
        for r in range(L.shape[0]):
            margin = gamma * gamma
            for i in range(n):
                g[i] = 0.0
                for j in range(n):
                    g[i] += M[i, j] * L[r, j]
                margin -= L[r, i] * g[i]
            if not margin > 0.0:
                info[0], info[1] = k, NO_FILTER
                return
            for i in range(n):
                for j in range(n):
                    M[i, j] += g[i] * g[j] / margin


@dataclass(frozen=True)
class Central:
    """A pass of the central filter: x, jump (N, n), P (N, n, n); where it ended and why (LEFT_BOUNDS, NO_FILTER)."""

    x: Array
    P: Array
    jump: Array
    failed_at: int | None
    why: int


def central(model: Model, record: Record, prior: Prior, L: Array, gamma: float) -> Central:
    """The central a posteriori H-infinity filter over one run, from prior.x0, P0 at its first sample, which is used."""
    program, n, N = model.program, model.program.n, len(record)
    outputs, parameters = program.outputs_count, program.parameters
    X, jump, P, info = np.zeros((N, n)), np.zeros((N, n)), np.zeros((N, n, n)), np.zeros(2, dtype=np.int64)
    vectors = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(outputs))
    squares = (np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)))
    own = (*vectors, *squares, np.zeros((outputs, n)), np.zeros((outputs, parameters)))
    central_pass(
        program.rate, program.output, *arrays(record.t, record.u), model.linear_inputs,
        *arrays(record.y, prior.x0, prior.P0), model.values, program.all_off(), np.zeros(0, dtype=np.int64),
        *arrays(np.diag(prior.Q), prior.R), model.angles, *arrays(L), gamma,
        workspace(n, program.inputs, parameters, 0), own, X, P, jump, info,
    )  # fmt: skip
    return Central(X, P, jump, None if info[0] < 0 else int(info[0]), int(info[1]))


def least_gamma(model: Model, record: Record, prior: Prior, L: Array) -> float:
    """The smallest gamma, to FOUND of itself, for which the filter exists over the whole run; infinite if none does.

    Bisection; on a nonlinear model existence also depends on the path, so that it is the end of one such interval.
    """
    if central(model, record, prior, L, HIGHEST).failed_at is not None:
        return math.inf
    high, low = 1.0, 0.0
    while central(model, record, prior, L, high).failed_at is not None:
        low, high = high, 10.0 * high
    while low == 0.0 and high > 1.0 / HIGHEST:
        if central(model, record, prior, L, 0.1 * high).failed_at is None:
            high *= 0.1
        else:
            low = 0.1 * high
    # Where nothing is uncertain the filter exists for every gamma.
    while low > 0.0 and high - low > FOUND * high:
        middle = math.sqrt(low * high)
        if central(model, record, prior, L, middle).failed_at is None:
            high = middle
        else:
            low = middle
    return high
