"""The prediction-error filter with sensitivities: one pass gives errors, their Jacobian and the predicted outputs.

theta = (x0, p[columns]). With Q = 0 this is exact output error (simulation); with Q > 0 an observer whose gain is
taken as constant in the derivatives. Measured channels are taken one at a time, so nothing is inverted:
s = H P H' + R,  e = nu / sqrt(s),  K = P H' / s,  x += K nu,  S -= K (H S),  P -= K H P,  de/dtheta = -(H S) / sqrt(s).
"""

from __future__ import annotations

import math
from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.factored import ROUNDING, WIDE, measured
from suite.kernels.integrate import WORK
from suite.kernels.step import step as move

DENSE = 16  # states up to which a product with zeros costs less than to look for them

# Hp (outputs, parameters), Hx (outputs, n), y (outputs,); x (n,); P, P2 (n, n); S, S2, T (n, n + columns)
FILTER_WORK = nb.types.Tuple(
    (nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.VECTOR)
)


@compile_kernel(
    nb.INT(
        nb.INT, nb.MODEL, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.INDICES,
        nb.MATRIX, nb.VECTOR, nb.INDICES, nb.INDICES, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.INT,
        WORK, FILTER_WORK, nb.MATRIX, nb.MATRIX, nb.CUBE, nb.MATRIX, nb.MATRIX,
    )
)  # fmt: skip
def prediction_errors(
    own: int, rate: Any, output: Any, t: Any, u: Any, linear: Any, y: Any, starts: Any,
    x0: Any, p: Any, on: Any, columns: Any, Q: Any, R: Any, angle: Any, substeps: int,
    work: Any, filter_work: Any, e: Any, s: Any, J: Any, X: Any, Y: Any,
) -> int:  # fmt: skip
    """Run over all samples; returns -1, or the first sample at which a number is no longer finite.

    own: the model's own step (see `step`) or 0; t (N,), u (N, inputs), y (N, outputs; NaN is missing), starts
    (runs + 1,): first sample of each run and N, x0 (runs, n), Q (n,) density of the process noise, R (outputs,)
    variance of a sample, angle (outputs,) 1 wraps.
    Writes e (N, outputs; 0 where missing), s (N, outputs; 1 where missing), J (N, outputs, n + columns: of the run's
    own x0, then of the parameters), X (N, n) the filtered state, Y (N, outputs) the predicted outputs.
    """
    xv, yv, Hx, Hp, P, P2, S, S2, T, K = filter_work
    n = x0.shape[1]
    ny = y.shape[1]
    m = columns.shape[0]
    width = n + m
    noisy = False
    for i in range(n):
        noisy = noisy or Q[i] > 0.0
    for run in range(starts.shape[0] - 1):
        first = starts[run]
        last = starts[run + 1]
        for i in range(n):
            xv[i] = x0[run, i]
            for j in range(width):
                S[i, j] = 1.0 if i == j else 0.0
            for j in range(n):
                P[i, j] = 0.0
        for step in range(first, last):
            if step > first:
                dt = t[step] - t[step - 1]
                before = step - 1
                move(own, rate, t[before], dt, u[before], u[step], linear, p, on, columns, substeps, xv, T, work)
                # S <- Phi S + [0 | G]
                for i in range(n):
                    for j in range(n):
                        S2[i, j] = 0.0
                    for j in range(n, width):
                        S2[i, j] = T[i, j]
                    for l in range(n):
                        slope = T[i, l]
                        if slope != 0.0:
                            for j in range(width):
                                S2[i, j] += slope * S[l, j]
                for i in range(n):
                    for j in range(width):
                        S[i, j] = S2[i, j]
                if noisy:
                    # P <- Phi P Phi' + Q dt
                    for i in range(n):
                        for j in range(n):
                            P2[i, j] = 0.0
                        for l in range(n):
                            slope = T[i, l]
                            if slope != 0.0:
                                for j in range(n):
                                    P2[i, j] += slope * P[l, j]
                    if n <= DENSE:
                        for i in range(n):
                            for j in range(i + 1):
                                total = 0.0
                                for l in range(n):
                                    total += P2[i, l] * T[j, l]
                                P[i, j] = total
                                P[j, i] = total
                            P[i, i] += Q[i] * dt
                    else:
                        # The same sums without the zeros of T: within a sample a state reaches few others.
                        for j in range(n):
                            for i in range(j, n):
                                P[i, j] = 0.0
                            for l in range(n):
                                slope = T[j, l]
                                if slope != 0.0:
                                    for i in range(j, n):
                                        P[i, j] += P2[i, l] * slope
                            P[j, j] += Q[j] * dt
                            for i in range(j, n):
                                P[j, i] = P[i, j]
            output(t[step], xv, u[step], p, on, yv, Hx, Hp)
            for c in range(ny):
                Y[step, c] = yv[c]
                e[step, c] = 0.0
                s[step, c] = 1.0
                for j in range(width):
                    J[step, c, j] = 0.0
            for i in range(n):
                if not math.isfinite(xv[i]):
                    return step
            for c in range(ny):
                if math.isnan(y[step, c]):
                    continue
                if c > 0 and noisy:
                    # The state moved with the channel before.
                    output(t[step], xv, u[step], p, on, yv, Hx, Hp)
                nu = y[step, c] - yv[c]
                if angle[c] > 0.0:
                    nu = math.atan2(math.sin(nu), math.cos(nu))
                variance = R[c]
                if noisy:
                    for i in range(n):
                        K[i] = 0.0
                        for j in range(n):
                            K[i] += P[i, j] * Hx[c, j]
                        variance += Hx[c, i] * K[i]
                wide = noisy and (variance > WIDE * R[c] or variance < R[c])
                if wide:
                    variance = measured(P, Hx[c], R[c], n * ROUNDING, P2, K)
                root = math.sqrt(variance)
                e[step, c] = nu / root
                s[step, c] = variance
                if not math.isfinite(e[step, c]):
                    return step
                for j in range(n):
                    J[step, c, j] = 0.0
                for j in range(m):
                    J[step, c, n + j] = -Hp[c, columns[j]] / root
                for i in range(n):
                    slope = Hx[c, i] / root
                    if slope != 0.0:
                        for j in range(width):
                            J[step, c, j] -= slope * S[i, j]
                if noisy:
                    for i in range(n):
                        gain = K[i] / variance
                        xv[i] += gain * nu
                        for j in range(width):
                            # S -= K (H S) with H S = -J root
                            S[i, j] += gain * J[step, c, j] * root
                    if wide:
                        continue
                    for i in range(n):
                        for j in range(n):
                            P[i, j] -= K[i] * K[j] / variance
            for i in range(n):
                X[step, i] = xv[i]
    return -1
