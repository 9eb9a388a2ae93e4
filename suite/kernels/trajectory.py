"""The true plant's states and its model error at the samples, in one compiled loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import FINEST, REACH, speed

Array = npt.NDArray[np.float64]

# Parts a sample is cut into at least: the truth is much finer than any estimator's own integration.
FINE = 20

# f, xs, dx (n,); us (inputs,); Fx (n, n); Fp (n, parameters): a plant, without the tangent that a long chain cannot pay
PLANT = nb.types.Tuple((nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.MATRIX))


def plant_workspace(n: int, inputs: int, parameters: int) -> tuple[Array, ...]:
    """The scratch arrays of `march`."""
    return np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(inputs), np.zeros((n, n)), np.zeros((n, parameters))


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.REAL, nb.REAL, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.INDICES, nb.VECTOR, PLANT,
    )
)  # fmt: skip
def march(rate: Any, t: float, dt: float, u0: Any, u1: Any, linear: Any, p: Any, none: Any, x: Any, work: Any) -> None:
    """Move x over dt by RK4 under the substep rule of `integrate`. Writes x and work."""
    f, xs, dx, us, Fx, Fp = work
    n = x.shape[0]
    done = 0.0
    while done < dt:
        h = min(dt / FINE, dt - done)
        for stage in range(4):
            # Offsets 0, h/2, h/2, h; weights 1, 2, 2, 1.
            offset = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            share = (done + offset) / dt
            for i in range(u0.shape[0]):
                us[i] = u0[i] + linear[i] * share * (u1[i] - u0[i])
            if stage == 0:
                rate(t + done, x, us, p, none, f, Fx, Fp)
                fastest = speed(Fx)
                if h * fastest > REACH:
                    h = max(REACH / fastest, dt / FINEST)
                    h = (dt - done) / math.ceil((dt - done) / h - 1e-9)
            else:
                for i in range(n):
                    xs[i] = x[i] + offset * f[i]
                rate(t + done + offset, xs, us, p, none, f, Fx, Fp)
            weight = 1.0 if stage == 0 or stage == 3 else 2.0
            for i in range(n):
                dx[i] = f[i] if stage == 0 else dx[i] + weight * f[i]
        for i in range(n):
            x[i] += h / 6.0 * dx[i]
        done += h
        if dt - done < 1e-9 * dt:
            break


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.MODEL, nb.VECTOR, nb.MODEL, nb.VECTOR, nb.MODEL, nb.VECTOR, nb.INT, nb.INDICES,
        nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX,
        PLANT, PLANT,
    )
)  # fmt: skip
def trajectory(
    sensors: Any, truth: Any, p: Any, model: Any, q: Any, mover: Any, r: Any, held: int, shared: Any,
    t: Any, u: Any, linear: Any, none: Any, X: Any, D: Any, Y: Any, Hx: Any, Hp: Any, work: Any, part: Any,
) -> None:  # fmt: skip
    """X (N, n), whose first row is given; D (N, m) = truth - model in the m shared states, by their places in X;
    Y (N, outputs), what the sensors (of the truth's parameters p) would read without noise.

    `mover` carries the state over each sample; with `held` the last of its parameters r are the push, set to D[k] at
    each sample. Writes X, D, Y, Hx, Hp, r, work (of the plant), part (of the model).
    """
    f, _, _, _, Fx, Fp = work
    g, z, _, _, Gx, Gp = part
    n, m = X.shape[1], D.shape[1]
    for k in range(t.shape[0]):
        for i in range(m):
            z[i] = X[k, shared[i]]
        truth(t[k], X[k], u[k], p, none, f, Fx, Fp)
        sensors(t[k], X[k], u[k], p, none, Y[k], Hx, Hp)
        model(t[k], z, u[k], q, none, g, Gx, Gp)
        for i in range(m):
            D[k, i] = f[shared[i]] - g[i]
            if held != 0:
                r[r.shape[0] - m + i] = D[k, i]
        if k + 1 < t.shape[0]:
            for i in range(n):
                X[k + 1, i] = X[k, i]
            march(mover, t[k], t[k + 1] - t[k], u[k], u[k + 1], linear, r, none, X[k + 1], work)
