"""Products of matrices that are known to be symmetric: half of the sums, and the same bits on both sides."""

from __future__ import annotations

from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.matrix import multiply, transpose

SMALL = 8  # states up to which products are plain sums


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX))
def symmetric(A: Any, B: Any, C: Any) -> None:
    """C = A B, square and known to be symmetric: row by row up to the diagonal. Writes C, which is neither A nor B."""
    n = A.shape[0]
    whole = n - n % 4
    for i in range(n):
        for j in range(i + 1):
            C[i, j] = 0.0
        for l in range(0, whole, 4):
            a0, a1, a2, a3 = A[i, l], A[i, l + 1], A[i, l + 2], A[i, l + 3]
            if a0 != 0.0 or a1 != 0.0 or a2 != 0.0 or a3 != 0.0:
                for j in range(i + 1):
                    C[i, j] += a0 * B[l, j] + a1 * B[l + 1, j] + a2 * B[l + 2, j] + a3 * B[l + 3, j]
        for l in range(whole, n):
            for j in range(i + 1):
                C[i, j] += A[i, l] * B[l, j]
    for i in range(n):
        for j in range(i):
            C[j, i] = C[i, j]


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX))
def turned(T: Any, S: Any, M: Any, W: Any, out: Any) -> None:
    """Symmetric T S T' of a symmetric S, as T (T S)'. Writes out, which may be S, and M, W."""
    n = T.shape[0]
    if n <= SMALL:
        for i in range(n):
            for j in range(n):
                total = 0.0
                for l in range(n):
                    total += T[i, l] * S[l, j]
                M[i, j] = total
        for i in range(n):
            for j in range(i + 1):
                total = 0.0
                for l in range(n):
                    total += M[i, l] * T[j, l]
                out[i, j] = total
                out[j, i] = total
        return
    multiply(T, S, M)
    transpose(M, W)
    symmetric(T, W, out)
