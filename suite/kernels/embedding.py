"""Invariant-embedding filters, continuous and discrete (Raol 2016, (47)-(55) and (63)-(74); SRA (92)-(95)).

Both take the source W of the Riccati equation, (1/(2 alpha)) Q^-1, with its sign: semi-robust adaptive estimation
(alpha = -gamma^2) is the same code. P = 2S makes them the extended Kalman-Bucy filter and the extended Kalman filter
with process-noise density (alpha Q)^-1.

info (3,) says how a run ended: sample of the failure or -1, its reason, first sample at which S >= 0 fails or -1.
Reasons: 1 the state is no longer finite, 2 S escapes, 3 the filter is too stiff for MOST_PARTS parts of a sample.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import WORK, advance, speed
from suite.kernels.matrix import (
    FLOW_WORK,
    MOST_PARTS,
    fastest,
    integrated_flow,
    multiply,
    semidefinite,
    transition_flow,
    transpose,
)

Array = npt.NDArray[np.float64]

# A part of a sample is shorter than GAIN_REACH over the filter's own speed (RK4 is stable up to 2.7).
GAIN_REACH = 1.0
# Beyond this a state is lost, whatever its unit.
LOST = 1e100

# x, xs, k, total, us, yv, f; Fp, Hp, Fx, Hx, B, S, half, end, L
EMBEDDING_WORK = nb.types.Tuple((nb.VECTOR,) * 7 + (nb.MATRIX,) * 9)
# What both filters are given, rate, output, t, u, linear, y, x0, S0, p, on, and what they write, X, S_out, D, info.
GIVEN = (
    nb.MODEL, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.INDICES,
)  # fmt: skip
WRITTEN = (nb.MATRIX, nb.CUBE, nb.MATRIX, nb.INDICES)


def embedding_workspace(n: int, inputs: int, parameters: int, outputs: int) -> tuple[Array, ...]:
    """The scratch arrays of both filters."""
    vectors = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(inputs), np.zeros(outputs), np.zeros(n))
    own = (np.zeros((n, parameters)), np.zeros((outputs, parameters)), np.zeros((n, n)), np.zeros((outputs, n)))
    return (*vectors, *own, *(np.zeros((n, n)) for _ in range(5)))


@compile_kernel(nb.types.void(nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.INDICES))
def begin(x0: Any, S0: Any, x: Any, S: Any, info: Any) -> None:
    """Set x, S to their first values, and info to a run of which nothing bad is known. Writes x, S, info."""
    info[0], info[1], info[2] = -1, 0, -1
    for i in range(x0.shape[0]):
        x[i] = x0[i]
        for j in range(x0.shape[0]):
            S[i, j] = S0[i, j]


@compile_kernel(nb.REAL(nb.REAL, nb.REAL))
def wrapped(e: float, angle: float) -> float:
    """The residual, on [-pi, pi] where it is an angle's."""
    return math.atan2(math.sin(e), math.cos(e)) if angle > 0.0 else e


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.REAL, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.REAL,
        nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.VECTOR,
    )
)  # fmt: skip
def correction(
    output: Any, t: float, x: Any, u: Any, p: Any, on: Any, S: Any, z0: Any, z1: Any, share: float,
    R: Any, angle: Any, yv: Any, Hx: Any, Hp: Any, d: Any,
) -> None:  # fmt: skip
    """D = 2 S H' R^-1 (z - h(x)), z on the line from z0 to z1 at `share`. Writes d and yv, Hx, Hp."""
    output(t, x, u, p, on, yv, Hx, Hp)
    n = x.shape[0]
    for i in range(n):
        d[i] = 0.0
    for c in range(yv.shape[0]):
        # A channel counts over a step only if it was measured at both of its ends.
        if math.isnan(z0[c]) or math.isnan(z1[c]):
            continue
        z = z0[c] + share * wrapped(z1[c] - z0[c], angle[c])
        e = 2.0 * wrapped(z - yv[c], angle[c]) / R[c]
        for i in range(n):
            for j in range(n):
                d[i] += S[i, j] * Hx[c, j] * e


@compile_kernel(
    nb.types.void(*GIVEN, nb.MATRIX, nb.MATRIX, nb.VECTOR, nb.INT, nb.INT, EMBEDDING_WORK, FLOW_WORK, *WRITTEN)
)
def continuous_embedding(
    rate: Any, output: Any, t: Any, u: Any, linear: Any, y: Any, x0: Any, S0: Any, p: Any, on: Any,
    W: Any, R: Any, angle: Any, integration: int, substeps: int, work: Any, flow_work: Any,
    X: Any, S_out: Any, D: Any, info: Any,
) -> None:  # fmt: skip
    """Xhat' = f + 2 S H' R^-1 (z - h), S' = F S + S F' - 2 S H' R^-1 H S + W (Raol (47), (49), (50)).

    t (N,), u (N, inputs), y (N, outputs; NaN is missing), x0 (n,), S0, W (n, n), R (N, outputs): spectral density over
    the step that ends at a sample (row 0: at the first sample), angle (outputs,). RK4 in at least `substeps` parts of
    a sample, z on a line between samples; Riccati by transition matrix, or by RK4 (`integration`).
    Writes X (N, n), S_out (N, n, n), D (N, n): dhat at the samples, info (3,), and the work arrays.
    """
    x, xs, slope, total, us, yv, f, Fp, Hp, Fx, Hx, B, S, half, end, L = work
    n = x0.shape[0]
    ny = y.shape[1]
    begin(x0, S0, x, S, info)
    for k in range(t.shape[0]):
        done = 0.0
        parts = 0
        dt = t[k] - t[k - 1] if k > 0 else 0.0
        while k > 0 and done < dt * (1.0 - 1e-12):
            now = t[k - 1] + done
            for i in range(us.shape[0]):
                us[i] = u[k - 1, i] + linear[i] * done / dt * (u[k, i] - u[k - 1, i])
            rate(now, x, us, p, on, f, Fx, Fp)
            output(now, x, us, p, on, yv, Hx, Hp)
            for i in range(n):
                for j in range(n):
                    B[i, j] = 0.0
                    for c in range(ny):
                        if not (math.isnan(y[k - 1, c]) or math.isnan(y[k, c])):
                            B[i, j] += 2.0 * Hx[c, i] * Hx[c, j] / R[k, c]
            # The filter's speed: the model's, the gain's now, and what the gain settles to, sqrt(q / R).
            gain = fastest(S, B, half, end)
            settled = fastest(W, B, half, end)
            own = speed(Fx) + max(gain, math.sqrt(settled))
            h = min(dt / substeps, GAIN_REACH / own if own > 0.0 else dt)
            parts += 1
            if not math.isfinite(own) or parts > MOST_PARTS:
                info[0], info[1] = k, 3 if math.isfinite(own) else 1
                return
            h = (dt - done) / math.ceil((dt - done) / h - 1e-9)
            if integration != 0:
                sound = integrated_flow(Fx, W, B, S, h, half, end, flow_work)
            else:
                sound = transition_flow(Fx, W, B, S, h, half, end, flow_work)
            if sound == 0:
                info[0], info[1] = k, 2
                return
            for stage in range(4):
                offset = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
                share = (done + offset) / dt
                for i in range(n):
                    xs[i] = x[i] if stage == 0 else x[i] + offset * slope[i]
                for i in range(us.shape[0]):
                    us[i] = u[k - 1, i] + linear[i] * share * (u[k, i] - u[k - 1, i])
                rate(now + offset, xs, us, p, on, f, Fx, Fp)
                there = S if stage == 0 else (end if stage == 3 else half)
                correction(
                    output, now + offset, xs, us, p, on, there, y[k - 1], y[k], share, R[k], angle, yv, Hx, Hp, slope
                )
                for i in range(n):
                    slope[i] += f[i]
                    if stage == 0:
                        total[i] = slope[i]
                    else:
                        total[i] += (1.0 if stage == 3 else 2.0) * slope[i]
            for i in range(n):
                x[i] += h / 6.0 * total[i]
                if not abs(x[i]) < LOST:
                    info[0], info[1] = k, 1
                    return
                for j in range(n):
                    S[i, j] = end[i, j]
            if info[2] < 0 and semidefinite(S, L) == 0:
                info[2] = k
            done += h
        correction(output, t[k], x, u[k], p, on, S, y[k], y[k], 0.0, R[k], angle, yv, Hx, Hp, slope)
        for i in range(n):
            X[k, i] = x[i]
            D[k, i] = slope[i]
            for j in range(n):
                S_out[k, i, j] = S[i, j]


@compile_kernel(
    nb.types.void(*GIVEN, nb.INDICES, nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.INT, WORK, EMBEDDING_WORK, *WRITTEN)
)
def discrete_embedding(
    rate: Any, output: Any, t: Any, u: Any, linear: Any, y: Any, x0: Any, S0: Any, p: Any, on: Any,
    none: Any, W: Any, R: Any, angle: Any, after: int, advance_work: Any, work: Any,
    X: Any, S_out: Any, D: Any, info: Any,
) -> None:  # fmt: skip
    """M = F S F' + W dt, S = [I + 2 M H' R^-1 H]^-1 M, xhat = f + 2 S H' R^-1 (z - h(f)) (Raol (63)-(74)).

    Arguments as in `continuous_embedding`, with R (outputs,) the variance of a sample; the first sample corrects
    x0, S0. A missing channel corrects nothing. `after`: dhat from the residual after the update, as (95) is printed.
    Writes X (N, n), S_out (N, n, n), D (N, n): the jump of each sample, info (3,), and the work arrays.
    """
    x, _, prior, jump, _, yv, f, _, Hp, T, Hx, B, S, M, _, L = work
    n = x0.shape[0]
    begin(x0, S0, x, S, info)
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            advance(rate, t[k - 1], dt, u[k - 1], u[k], linear, p, on, none, 1, x, T, advance_work)
            multiply(T, S, B)
            # F S F' + W dt as F (F S)' + W dt
            transpose(B, S)
            multiply(T, S, M)
            for i in range(n):
                for j in range(n):
                    S[i, j] = 0.5 * (M[i, j] + M[j, i] + (W[i, j] + W[j, i]) * dt)
        for i in range(n):
            prior[i] = x[i]
        output(t[k], prior, u[k], p, on, yv, Hx, Hp)
        for c in range(yv.shape[0]):
            if math.isnan(y[k, c]):
                continue
            # One channel of [I + 2 M H' R^-1 H]^-1 M:  S -= 2 S h h' S / (R + 2 h' S h)
            variance = R[c]
            for i in range(n):
                f[i] = 0.0
                for j in range(n):
                    f[i] += S[i, j] * Hx[c, j]
                variance += 2.0 * Hx[c, i] * f[i]
            for i in range(n):
                for j in range(n):
                    S[i, j] -= 2.0 * f[i] * f[j] / variance
        correction(output, t[k], prior, u[k], p, on, S, y[k], y[k], 0.0, R, angle, yv, Hx, Hp, jump)
        sound = True
        for i in range(n):
            x[i] = prior[i] + jump[i]
            X[k, i] = x[i]
            sound = sound and abs(x[i]) < LOST
            for j in range(n):
                S_out[k, i, j] = S[i, j]
                sound = sound and abs(S[i, j]) < LOST
        if not sound:
            info[0], info[1] = k, 2 if abs(S[0, 0]) >= LOST else 1
            return
        if info[2] < 0 and semidefinite(S, L) == 0:
            info[2] = k
        if after != 0:
            correction(output, t[k], x, u[k], p, on, S, y[k], y[k], 0.0, R, angle, yv, Hx, Hp, jump)
        for i in range(n):
            D[k, i] = jump[i]
