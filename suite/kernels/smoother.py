"""Fixed-interval smoother on a stored filter pass, by the adjoint: no covariance is inverted.

The modified Bryson-Frazier recursion (Bierman 1973) runs lambda and its information Lambda backwards,
    over a channel:  lambda <- (I - K H)' lambda + H' nu / s,   Lambda <- (I - K H)' Lambda (I - K H) + H' H / s
    over a step:     lambda <- Phi' lambda,                     Lambda <- Phi' Lambda Phi
and x_s = x + P lambda, P_s = P - P Lambda P. It equals the Rauch-Tung-Striebel smoother and also holds where P is
singular (known initial states, equations without noise). lambda is half the costate of the minimum-model-error
problem (MATH 2 of the docs; Mook and Junkins 1988), so that d = (alpha Q)^-1 lambda.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.matrix import multiply, transpose
from suite.kernels.symmetric import symmetric, turned

Array = npt.NDArray[np.float64]

# v, l0 (n,); A, B, W (n, n)
SMOOTHER_WORK = nb.types.Tuple((nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.MATRIX))


def adjoint_workspace(n: int) -> tuple[Array, ...]:
    """The scratch arrays of `adjoint`."""
    return (*np.zeros((2, n)), *np.zeros((3, n, n)))


@compile_kernel(
    nb.types.void(
        nb.CUBE, nb.CUBE, nb.CUBE, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.CUBE,
        SMOOTHER_WORK, nb.MATRIX, nb.CUBE, nb.MATRIX, nb.CUBE, nb.MATRIX, nb.CUBE,
    )
)  # fmt: skip
def adjoint(
    Phi: Any, H: Any, K: Any, nu: Any, s: Any, X: Any, P: Any,
    work: Any, Xs: Any, Ps: Any, before: Any, Before: Any, after: Any, After: Any,
) -> None:  # fmt: skip
    """Run backwards over one run.

    Phi, P (N, n, n), H, K (N, outputs, n), nu, s (N, outputs; s = 1, nu = K = 0 where missing), X (N, n) filtered.
    Writes Xs, Ps smoothed, before/Before lambda and Lambda ahead of each sample's measurement, after/After behind
    it, and work.
    """
    v, l0, A, B, W = work
    N, n = X.shape
    for k in range(N - 1, -1, -1):
        for i in range(n):
            v[i] = 0.0
            if k < N - 1:
                for j in range(n):
                    v[i] += Phi[k + 1, j, i] * before[k + 1, j]
            after[k, i] = v[i]
        if k < N - 1:
            transpose(Phi[k + 1], B)
            turned(B, Before[k + 1], A, W, After[k])
        else:
            After[k] = 0.0
        multiply(After[k], P[k], A)
        symmetric(P[k], A, B)
        for i in range(n):
            Xs[k, i] = X[k, i]
            for j in range(n):
                Xs[k, i] += P[k, i, j] * v[j]
                Ps[k, i, j] = P[k, i, j] - B[i, j]
        for i in range(n):
            for j in range(n):
                B[i, j] = After[k, i, j]
        for c in range(H.shape[1] - 1, -1, -1):
            used = False
            for i in range(n):
                used = used or K[k, c, i] != 0.0
            if not used and nu[k, c] == 0.0:
                continue
            # lambda - H' (K' lambda - nu / s)
            total = -nu[k, c] / s[k, c]
            for i in range(n):
                total += K[k, c, i] * v[i]
            for i in range(n):
                v[i] -= H[k, c, i] * total
            # (I - K H)' B (I - K H) = B - H' (K' B) - (B K) H + H' (K' B K) H
            inner = 1.0 / s[k, c]
            for i in range(n):
                l0[i] = 0.0
                for j in range(n):
                    l0[i] += B[i, j] * K[k, c, j]
                inner += K[k, c, i] * l0[i]
            for i in range(n):
                for j in range(n):
                    B[i, j] += H[k, c, i] * H[k, c, j] * inner - H[k, c, i] * l0[j] - l0[i] * H[k, c, j]
        for i in range(n):
            before[k, i] = v[i]
            for j in range(n):
                Before[k, i, j] = 0.5 * (B[i, j] + B[j, i])
