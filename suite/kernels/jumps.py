"""What a filter's jump at a sample means as a rate: the model error that would have made it within the step."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import zeta

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.matrix import exponential, solve

Array = npt.NDArray[np.float64]

TERMS = 40
# Of z/(e^z - 1): 1, -1/2, then 2 (-1)^(k+1) zeta(2k) / (2 pi)^(2k) for z^(2k).
EVEN = {k: (-2.0 if k % 4 == 0 else 2.0) * float(zeta(k)) / (2.0 * np.pi) ** k for k in range(2, TERMS + 1, 2)}
SERIES = (1.0, -0.5, *(EVEN.get(k, 0.0) for k in range(2, TERMS + 1)))
SMALL = 1e-15  # of the sum: a term below this is rounding
NOTHING = 1e-30  # of the largest rate: what a chain's far end has of a push at the other

# f (n,); Fx (n, n), Fp (n, parameters), G (n, n), d (n, 1); A, E, A2, A3, A4, T (2n, 2n)
JUMP_WORK = nb.types.Tuple((nb.VECTOR,) + (nb.MATRIX,) * 10)


def jump_workspace(n: int, parameters: int) -> tuple[Array, ...]:
    """The scratch arrays of `rates_from_jumps`."""
    own = (np.zeros(n), np.zeros((n, n)), np.zeros((n, parameters)), np.zeros((n, n)), np.zeros((n, 1)))
    return (*own, *(np.zeros((2 * n, 2 * n)) for _ in range(6)))


@compile_kernel(nb.types.boolean(nb.MATRIX, nb.REAL, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.MATRIX))
def _by_series(F: Any, dt: float, jump: Any, rate: Any, power: Any, after: Any) -> bool:
    """rate = G^-1 jump by the series of z/(e^z - 1), z = F dt, in products of a matrix with a vector alone.

    It converges where the eigenvalues of F dt are below 2 pi in size; False where it has not after TERMS terms.
    power (n,) and after (n, 1) are scratch.
    """
    n = jump.shape[0]
    for i in range(n):
        power[i] = jump[i]
        rate[i] = jump[i]
    for order in range(1, TERMS + 1):
        for i in range(n):
            after[i, 0] = 0.0
            for j in range(n):
                if F[i, j] != 0.0:
                    after[i, 0] += F[i, j] * dt * power[j]
        for i in range(n):
            power[i] = after[i, 0]
        share = SERIES[order]
        if share == 0.0:
            continue
        largest = 0.0
        for i in range(n):
            rate[i] += share * power[i]
            largest = max(largest, abs(rate[i]))
        settled = order > 1
        for i in range(n):
            if abs(share * power[i]) > max(SMALL * abs(rate[i]), NOTHING * largest):
                settled = False
        if settled:
            for i in range(n):
                rate[i] /= dt
            return True
    return False


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.MATRIX, JUMP_WORK, nb.MATRIX
    )
)  # fmt: skip
def rates_from_jumps(rate: Any, t: Any, u: Any, p: Any, on: Any, X: Any, jumps: Any, work: Any, D: Any) -> None:
    """D = G^-1 jump, G = integral of e^(F s) over the step that ends at a sample, not dt alone.

    F is the model's Jacobian at the filtered state X (N, n) ahead of the step. Writes D (N, n), 0 at the first
    sample, whose jump corrects the initial state, and the work arrays.
    """
    f, Fx, Fp, G, d, A, E, A2, A3, A4, T = work
    n = X.shape[1]
    for i in range(n):
        D[0, i] = 0.0
    for k in range(1, t.shape[0]):
        dt = t[k] - t[k - 1]
        rate(t[k - 1], X[k - 1], u[k - 1], p, on, f, Fx, Fp)
        if _by_series(Fx, dt, jumps[k], D[k], f, d):
            continue
        # exp([[F, I], [0, 0]] dt) holds the integral in its upper right block.
        for i in range(n):
            for j in range(n):
                A[i, j] = Fx[i, j] * dt
                A[i, n + j] = dt if i == j else 0.0
                A[n + i, j] = 0.0
                A[n + i, n + j] = 0.0
        exponential(A, E, A2, A3, A4, T)
        for i in range(n):
            d[i, 0] = jumps[k, i]
            for j in range(n):
                G[i, j] = E[i, n + j]
        singular = solve(G, d) == 0
        for i in range(n):
            D[k, i] = jumps[k, i] / dt if singular else d[i, 0]
