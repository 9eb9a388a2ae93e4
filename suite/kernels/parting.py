"""How neighbouring runs part along a path: the tangent of the model's steps, chained."""

from __future__ import annotations

import math
from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import WORK
from suite.kernels.step import step


@compile_kernel(
    nb.INT(
        nb.INT, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.INDICES, nb.INDICES, nb.MATRIX, nb.VECTOR,
        nb.MATRIX, nb.VECTOR, nb.MATRIX, WORK, nb.CUBE, nb.VECTOR,
    )
)  # fmt: skip
def parting(
    own: int, rate: Any, t: Any, u: Any, linear: Any, p: Any, on: Any, none: Any, X: Any, scale: Any,
    V: Any, x: Any, T: Any, work: Any, tangents: Any, logs: Any,
) -> int:  # fmt: skip
    """V <- Phi V of each step from the states X (N, n), in units `scale` (n,) of the states, and then of length one.

    V (n, n) is that at the first sample. Writes tangents (N - 1, n, n): V after each step, logs (N - 1,): the logarithm
    of the length that it lost there, and V, x (n,), T (n, n), work. Returns the steps made: fewer than N - 1 where V
    is zero or no longer finite.
    """
    n = X.shape[1]
    for k in range(t.shape[0] - 1):
        for i in range(n):
            x[i] = X[k, i]
        step(own, rate, t[k], t[k + 1] - t[k], u[k], u[k + 1], linear, p, on, none, 1, x, T, work)
        W = tangents[k]
        size = 0.0
        for i in range(n):
            for j in range(n):
                W[i, j] = 0.0
            for l in range(n):
                slope = T[i, l] * scale[l] / scale[i]
                if slope != 0.0:
                    for j in range(n):
                        W[i, j] += slope * V[l, j]
            for j in range(n):
                size += W[i, j] * W[i, j]
        size = math.sqrt(size)
        if not math.isfinite(size) or size == 0.0:
            return k
        for i in range(n):
            for j in range(n):
                W[i, j] /= size
                V[i, j] = W[i, j]
        logs[k] = math.log(size)
    return int(t.shape[0] - 1)
