"""The extended Kalman filter: one compiled pass that stores what a smoother needs.

The measured channels of a sample are taken one at a time at one linearisation, which is the joint update without an
inverse:  s = H P H' + R,  K = P H' / s,  x += K nu,  P -= K s K',  nu = y - h(x-) - H (x - x-);
P by its factors where that difference would lose it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.factored import ROUNDING, WIDE, measured
from suite.kernels.integrate import WORK
from suite.kernels.step import step
from suite.kernels.symmetric import turned

Array = npt.NDArray[np.float64]

# Hp (outputs, parameters); x, base (n,); M (n, n); yv (outputs,)
EKF_WORK = nb.types.Tuple((nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.VECTOR))


def ekf_workspace(n: int, parameters: int, outputs: int) -> tuple[Array, ...]:
    """The scratch arrays of `ekf`."""
    return np.zeros((outputs, parameters)), np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros(outputs)


@compile_kernel(
    nb.INT(
        nb.INT, nb.MODEL, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.INT, nb.VECTOR,
        nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.INT, nb.VECTOR, nb.VECTOR, nb.INDICES, WORK, EKF_WORK,
        nb.MATRIX, nb.CUBE, nb.MATRIX, nb.CUBE, nb.CUBE, nb.CUBE, nb.CUBE, nb.CUBE, nb.MATRIX, nb.MATRIX,
    )
)  # fmt: skip
def ekf(
    own: int, rate: Any, output: Any, t: Any, u: Any, linear: Any, y: Any, nominal: Any, departure: Any, around: int,
    x0: Any, P0: Any, p: Any, on: Any, Q: Any, spread: int, R: Any, angle: Any, none: Any, work: Any, ekf_work: Any,
    X: Any, P: Any, Xp: Any, Pp: Any, Phi: Any, Qd: Any, H: Any, K: Any, nu: Any, s: Any,
) -> int:  # fmt: skip
    """Run over one run; returns -1, or the first sample at which a number is no longer finite.

    own: the model's own step (see `step`) or 0; t (N,), u (N, inputs), y (N, outputs; NaN is missing), nominal,
    departure (N, n): where to linearise the output at a sample and the step from it if `around`, else at the filter's
    own estimates; Q (n, n) density of the process noise, added as Q dt at the end of a step, or (`spread`) as
    dt (Phi Q Phi' + Q)/2, its integral over the step to second order; R (outputs,), angle (outputs,) 1 wraps.
    Writes X, P filtered, Xp, Pp predicted, Phi, Qd of the step into a sample (N, n, n), H and K (N, outputs, n),
    nu and s (N, outputs; 0 and 1 where missing), and the work arrays.
    """
    Hp, x, base, M, yv = ekf_work
    n = x0.shape[0]
    ny = y.shape[1]
    for i in range(n):
        x[i] = x0[i]
        for j in range(n):
            Pp[0, i, j] = P0[i, j]
            Phi[0, i, j] = 1.0 if i == j else 0.0
            Qd[0, i, j] = 0.0
    for k in range(t.shape[0]):
        C = P[k]
        if k > 0:
            dt = t[k] - t[k - 1]
            T = Phi[k]
            for i in range(n):
                base[i] = departure[k - 1, i] if around != 0 else x[i]
                # x becomes the distance from the point of linearisation.
                x[i] -= base[i]
            step(own, rate, t[k - 1], dt, u[k - 1], u[k], linear, p, on, none, 1, base, T, work)
            # x- = f(departure) + Phi (x - departure),  P- = Phi P Phi' + Qd
            for i in range(n):
                for j in range(n):
                    base[i] += T[i, j] * x[j]
                    Qd[k, i, j] = dt * Q[i, j]
            for i in range(n):
                x[i] = base[i]
            if spread != 0:
                turned(T, Q, M, C, Qd[k])
                for i in range(n):
                    for j in range(n):
                        Qd[k, i, j] = 0.5 * dt * (Qd[k, i, j] + Q[i, j])
            turned(T, P[k - 1], M, C, Pp[k])
            for i in range(n):
                for j in range(n):
                    Pp[k, i, j] += Qd[k, i, j]
        for i in range(n):
            Xp[k, i] = x[i]
            for j in range(n):
                C[i, j] = Pp[k, i, j]
            base[i] = nominal[k, i] if around != 0 else x[i]
        output(t[k], base, u[k], p, on, yv, H[k], Hp)
        for c in range(ny):
            nu[k, c] = 0.0
            s[k, c] = 1.0
            h = H[k, c]
            gain = K[k, c]
            for i in range(n):
                gain[i] = 0.0
            if math.isnan(y[k, c]):
                continue
            e = y[k, c] - yv[c]
            if angle[c] > 0.0:
                e = math.atan2(math.sin(e), math.cos(e))
            variance = R[c]
            # C H' along the rows of the symmetric C: most outputs read few states.
            for j in range(n):
                slope = h[j]
                if slope != 0.0:
                    e -= slope * (x[j] - base[j])
                    for i in range(n):
                        gain[i] += C[j, i] * slope
            for i in range(n):
                variance += h[i] * gain[i]
            wide = variance > WIDE * R[c] or variance < R[c]
            if wide:
                variance = measured(C, h, R[c], n * ROUNDING, M, gain)
            nu[k, c] = e
            s[k, c] = variance
            for i in range(n):
                gain[i] /= variance
                x[i] += gain[i] * e
            if wide:
                continue
            for i in range(n):
                for j in range(n):
                    C[i, j] -= gain[i] * gain[j] * variance
        sound = True
        for i in range(n):
            X[k, i] = x[i]
            sound = sound and math.isfinite(x[i])
            for j in range(n):
                sound = sound and math.isfinite(C[i, j])
        if not sound:
            return k
    return -1
