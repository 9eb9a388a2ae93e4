"""What a filter's jump at a sample means as a rate: the model error that would have made it within the step."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.matrix import exponential, solve

Array = npt.NDArray[np.float64]

# f (n,); Fx (n, n), Fp (n, parameters), G (n, n), d (n, 1); A, E, T1, T2 (2n, 2n)
JUMP_WORK = nb.types.Tuple((nb.VECTOR,) + (nb.MATRIX,) * 8)


def jump_workspace(n: int, parameters: int) -> tuple[Array, ...]:
    """The scratch arrays of `rates_from_jumps`."""
    own = (np.zeros(n), np.zeros((n, n)), np.zeros((n, parameters)), np.zeros((n, n)), np.zeros((n, 1)))
    return (*own, *(np.zeros((2 * n, 2 * n)) for _ in range(4)))


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.MATRIX, JUMP_WORK, nb.MATRIX
    )
)  # fmt: skip
def rates_from_jumps(rate: Any, t: Any, u: Any, p: Any, on: Any, X: Any, jumps: Any, work: Any, D: Any) -> None:
    """D = G^-1 jump, G = integral of e^(F s) over the step that ends at a sample (MATH 4: not by dt alone).

    F is the model's Jacobian at the filtered state X (N, n) ahead of the step. Writes D (N, n), 0 at the first
    sample, whose jump corrects the initial state, and the work arrays.
    """
    f, Fx, Fp, G, d, A, E, T1, T2 = work
    n = X.shape[1]
    for i in range(n):
        D[0, i] = 0.0
    for k in range(1, t.shape[0]):
        dt = t[k] - t[k - 1]
        rate(t[k - 1], X[k - 1], u[k - 1], p, on, f, Fx, Fp)
        # exp([[F, I], [0, 0]] dt) holds the integral in its upper right block.
        for i in range(n):
            for j in range(n):
                A[i, j] = Fx[i, j] * dt
                A[i, n + j] = dt if i == j else 0.0
                A[n + i, j] = 0.0
                A[n + i, n + j] = 0.0
        exponential(A, E, T1, T2)
        for i in range(n):
            d[i, 0] = jumps[k, i]
            for j in range(n):
                G[i, j] = E[i, n + j]
        singular = solve(G, d) == 0
        for i in range(n):
            D[k, i] = jumps[k, i] / dt if singular else d[i, 0]
