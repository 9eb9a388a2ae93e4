"""One sample of x' = f(x, u, t; p) by RK4, with its derivatives by the state and by chosen parameters.

Substep rule: a sample is cut into at least `substeps` equal parts; a part is cut further so that h * rho <= REACH,
where rho bounds the speed of the dynamics at its start, but never below dt / FINEST. The bound
max_i (|F_ii| + sum_j sqrt(|F_ij F_ji|)) does not change when a state is measured in other units, and a chain of
integrators has speed zero. At REACH = 0.3 the error of a part is below 3e-5 of the state's change.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel

Array = npt.NDArray[np.float64]

REACH = 0.3
FINEST = 256.0

# f, xs, dx (n,); us (inputs,); Fx (n, n); Fp (n, parameters); Ts, k, total (n, n + columns)
WORK = nb.types.Tuple(
    (nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX)
)


def workspace(n: int, inputs: int, parameters: int, columns: int) -> tuple[Array, ...]:
    """The scratch arrays of `advance`."""
    wide = (n, n + columns)
    return (
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(inputs),
        np.zeros((n, n)),
        np.zeros((n, parameters)),
        np.zeros(wide),
        np.zeros(wide),
        np.zeros(wide),
    )


@compile_kernel(nb.types.float64(nb.MATRIX))
def speed(F: Any) -> float:
    """A bound of how fast x' = F x moves, the same in any units of the states."""
    n = F.shape[0]
    fastest = 0.0
    for i in range(n):
        row = abs(F[i, i])
        for j in range(n):
            if j != i:
                row += math.sqrt(abs(F[i, j] * F[j, i]))
        fastest = max(fastest, row)
    return fastest


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.REAL, nb.REAL, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.INDICES, nb.INDICES, nb.INT,
        nb.VECTOR, nb.MATRIX, WORK,
    )
)  # fmt: skip
def advance(
    rate: Any, t: float, dt: float, u0: Any, u1: Any, linear: Any, p: Any, on: Any, columns: Any, substeps: int,
    x: Any, T: Any, work: Any,
) -> None:  # fmt: skip
    """Move x over dt; write T = [dx/dx0 | dx/dp[columns]], started at [I | 0]. Writes x, T and work.

    x' = f,  Phi' = F_x Phi,  G' = F_x G + F_p, all by the same four stages.
    """
    f, xs, dx, us, Fx, Fp, Ts, k, total = work
    n = x.shape[0]
    nu = u0.shape[0]
    m = columns.shape[0]
    width = n + m
    for i in range(n):
        for j in range(width):
            T[i, j] = 1.0 if i == j else 0.0
    done = 0.0
    while done < dt:
        h = min(dt / substeps, dt - done)
        for stage in range(4):
            # Offsets 0, h/2, h/2, h; weights 1, 2, 2, 1.
            offset = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            share = (done + offset) / dt
            for i in range(nu):
                us[i] = u0[i] + linear[i] * share * (u1[i] - u0[i])
            if stage == 0:
                rate(t + done, x, us, p, on, f, Fx, Fp)
                fastest = speed(Fx)
                if h * fastest > REACH:
                    h = max(REACH / fastest, dt / FINEST)
                    # Equal parts of what is left, so that no sliver remains.
                    h = (dt - done) / math.ceil((dt - done) / h - 1e-9)
            else:
                for i in range(n):
                    xs[i] = x[i] + offset * f[i]
                    for j in range(width):
                        Ts[i, j] = T[i, j] + offset * k[i, j]
                rate(t + done + offset, xs, us, p, on, f, Fx, Fp)
            weight = 1.0 if stage == 0 or stage == 3 else 2.0
            Tn = T if stage == 0 else Ts
            for i in range(n):
                dx[i] = f[i] if stage == 0 else dx[i] + weight * f[i]
                # k = F_x T + F_p, row by row: most rates depend on few states.
                for j in range(n):
                    k[i, j] = 0.0
                for j in range(m):
                    k[i, n + j] = Fp[i, columns[j]]
                for l in range(n):
                    slope = Fx[i, l]
                    if slope != 0.0:
                        for j in range(width):
                            k[i, j] += slope * Tn[l, j]
                for j in range(width):
                    total[i, j] = k[i, j] if stage == 0 else total[i, j] + weight * k[i, j]
        for i in range(n):
            x[i] += h / 6.0 * dx[i]
            for j in range(width):
                T[i, j] += h / 6.0 * total[i, j]
        done += h
        if dt - done < 1e-9 * dt:
            break


def transition(
    program: Any, t: float, x: Array, u0: Array, u1: Array, linear: Array, p: Array, dt: float
) -> tuple[Array, Array]:
    """The state after dt and its derivative by the state before, in new arrays; plain numpy in and out."""
    n = program.n
    after, T = x.copy(), np.zeros((n, n))
    none = np.zeros(0, dtype=np.int64)
    work = workspace(n, program.inputs, program.parameters, 0)
    advance(program.rate, float(t), float(dt), u0, u1, linear, p, program.all_off(), none, 1, after, T, work)
    return after, T
