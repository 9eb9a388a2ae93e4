"""The extended Kalman filter: one compiled pass that stores what a smoother needs.

The measured channels of a sample are taken one at a time at one linearisation, which is the joint update without an
inverse:  s = H P H' + R,  K = P H' / s,  x += K nu,  P -= K s K',  nu = y - h(x-) - H (x - x-).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import WORK, advance, workspace
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

# Hp (outputs, parameters); x, base (n,); T, P, P2 (n, n)
EKF_WORK = nb.types.Tuple((nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.VECTOR))


@compile_kernel(
    nb.INT(
        nb.MODEL, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.INT, nb.VECTOR,
        nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.INT, nb.VECTOR, nb.VECTOR, nb.INDICES, WORK, EKF_WORK,
        nb.MATRIX, nb.CUBE, nb.MATRIX, nb.CUBE, nb.CUBE, nb.CUBE, nb.CUBE, nb.CUBE, nb.MATRIX, nb.MATRIX,
    )
)  # fmt: skip
def ekf(
    rate: Any, output: Any, t: Any, u: Any, linear: Any, y: Any, nominal: Any, departure: Any, around: int,
    x0: Any, P0: Any, p: Any, on: Any, Q: Any, spread: int, R: Any, angle: Any, none: Any, work: Any, ekf_work: Any,
    X: Any, P: Any, Xp: Any, Pp: Any, Phi: Any, Qd: Any, H: Any, K: Any, nu: Any, s: Any,
) -> int:  # fmt: skip
    """Run over one run; returns -1, or the first sample at which a number is no longer finite.

    t (N,), u (N, inputs), y (N, outputs; NaN is missing), nominal, departure (N, n): where to linearise the output
    at a sample and the step from it if `around`, else at the filter's own estimates; Q (n, n) density of the process
    noise, added as Q dt at the end of a step, or (`spread`) as dt (Phi Q Phi' + Q)/2, its integral over the step to
    second order; R (outputs,), angle (outputs,) 1 wraps.
    Writes X, P filtered, Xp, Pp predicted, Phi, Qd of the step into a sample (N, n, n), H and K (N, outputs, n),
    nu and s (N, outputs; 0 and 1 where missing), and the work arrays.
    """
    Hp, x, base, T, C, C2, yv = ekf_work
    n = x0.shape[0]
    ny = y.shape[1]
    for i in range(n):
        x[i] = x0[i]
        for j in range(n):
            C[i, j] = P0[i, j]
            Phi[0, i, j] = 1.0 if i == j else 0.0
            Qd[0, i, j] = 0.0
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            for i in range(n):
                base[i] = departure[k - 1, i] if around != 0 else x[i]
                # x becomes the distance from the point of linearisation.
                x[i] -= base[i]
            advance(rate, t[k - 1], dt, u[k - 1], u[k], linear, p, on, none, 1, base, T, work)
            # x- = f(departure) + Phi (x - departure),  P- = Phi P Phi' + Qd
            for i in range(n):
                for j in range(n):
                    base[i] += T[i, j] * x[j]
                    Phi[k, i, j] = T[i, j]
                    total = 0.0
                    noise = 0.0
                    for l in range(n):
                        total += T[i, l] * C[l, j]
                        noise += T[i, l] * Q[l, j]
                    C2[i, j] = total
                    Qd[k, i, j] = noise
            for i in range(n):
                x[i] = base[i]
                for j in range(i + 1):
                    total = 0.0
                    noise = 0.0
                    for l in range(n):
                        total += C2[i, l] * T[j, l]
                        noise += Qd[k, i, l] * T[j, l]
                    # The upper triangle is kept for the rows below, which still read it.
                    C[i, j] = 0.5 * dt * (noise + Q[i, j]) if spread != 0 else dt * Q[i, j]
                    Pp[k, i, j] = total + C[i, j]
            for i in range(n):
                for j in range(i + 1):
                    Qd[k, i, j] = C[i, j]
                    Qd[k, j, i] = C[i, j]
                    Pp[k, j, i] = Pp[k, i, j]
            for i in range(n):
                for j in range(n):
                    C[i, j] = Pp[k, i, j]
        for i in range(n):
            Xp[k, i] = x[i]
            for j in range(n):
                Pp[k, i, j] = C[i, j]
            base[i] = nominal[k, i] if around != 0 else x[i]
        output(t[k], base, u[k], p, on, yv, H[k], Hp)
        for c in range(ny):
            nu[k, c] = 0.0
            s[k, c] = 1.0
            for i in range(n):
                K[k, c, i] = 0.0
            if math.isnan(y[k, c]):
                continue
            e = y[k, c] - yv[c]
            if angle[c] > 0.0:
                e = math.atan2(math.sin(e), math.cos(e))
            variance = R[c]
            for i in range(n):
                e -= H[k, c, i] * (x[i] - base[i])
                for j in range(n):
                    K[k, c, i] += C[i, j] * H[k, c, j]
                variance += H[k, c, i] * K[k, c, i]
            nu[k, c] = e
            s[k, c] = variance
            for i in range(n):
                K[k, c, i] /= variance
                x[i] += K[k, c, i] * e
            for i in range(n):
                for j in range(n):
                    C[i, j] -= K[k, c, i] * K[k, c, j] * variance
        sound = True
        for i in range(n):
            X[k, i] = x[i]
            sound = sound and math.isfinite(x[i])
            for j in range(n):
                P[k, i, j] = C[i, j]
                sound = sound and math.isfinite(C[i, j])
        if not sound:
            return k
    return -1


@dataclass(frozen=True)
class Filtered:
    """One pass over N samples of n states and m channels.

    x, x_prior (N, n); P, P_prior (N, n, n); Phi, Qd (N, n, n): transition and process noise of the step that ends at
    a sample; H, K (N, m, n); innovation, variance (N, m): of the channels one after another, 0 and 1 where missing;
    failed_at: None, or the sample at which a number was no longer finite (later entries then mean nothing).
    """

    x: Array
    P: Array
    x_prior: Array
    P_prior: Array
    Phi: Array
    Qd: Array
    H: Array
    K: Array
    innovation: Array
    variance: Array
    failed_at: int | None = None

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the innovations' density, up to the constant of 2 pi."""
        return -0.5 * float(np.sum(self.innovation**2 / self.variance + np.log(self.variance)))


def filtered(
    model: Model, record: Record, x0: Array, P0: Array, Q: Array, R: Array,
    *, spread: bool = False, around: tuple[Array, Array] | None = None,
) -> Filtered:  # fmt: skip
    """The extended Kalman filter over one run, from x0, P0 at its first sample, which is used too.

    Q (n,) or (n, n): density of the process noise; R (outputs,): variance of a sample; `spread`: the noise acts
    through the step, not at its end; `around`, two (N, n): linearise the outputs and the
    steps there (iterated smoother).
    """
    program, N = model.program, len(record)
    n, m = program.n, program.outputs_count
    density = np.diag(Q) if np.ndim(Q) == 1 else Q
    X, Xp = np.zeros((N, n)), np.zeros((N, n))
    P, Pp, Phi, Qd = (np.zeros((N, n, n)) for _ in range(4))
    H, K = np.zeros((N, m, n)), np.zeros((N, m, n))
    nu, s = np.zeros((N, m)), np.ones((N, m))
    work = (
        np.zeros((m, program.parameters)),
        np.zeros(n),
        np.zeros(n),
        *(np.zeros((n, n)) for _ in range(3)),
        np.zeros(m),
    )
    failed = ekf(
        program.rate, program.output, *arrays(record.t, record.u), model.linear_inputs, *arrays(record.y),
        *arrays(*(around or (X, X))), int(around is not None), *arrays(x0, P0), model.values,
        program.all_off(), *arrays(density), int(spread), *arrays(R), angles(model), np.zeros(0, dtype=np.int64),
        workspace(n, program.inputs, program.parameters, 0), work, X, P, Xp, Pp, Phi, Qd, H, K, nu, s,
    )  # fmt: skip
    return Filtered(X, P, Xp, Pp, Phi, Qd, H, K, nu, s, None if failed < 0 else int(failed))


def arrays(*values: Any) -> tuple[Array, ...]:
    """The values as a kernel wants them: contiguous numbers."""
    return tuple(np.ascontiguousarray(value, dtype=np.float64) for value in values)


def angles(model: Model) -> Array:
    """1 where an output is an angle, whose residual wraps at +-pi, (outputs,)."""
    return np.array([float(output.angle) for output in model.outputs.values()])


def held(values: Array, failed_at: int | None) -> Array:
    """The values with the last finite entry before `failed_at` in place of all that follows (zero if there is none)."""
    if failed_at is None:
        return values
    kept = values.copy()
    kept[failed_at:] = values[failed_at - 1] if failed_at > 0 else 0.0
    return kept
