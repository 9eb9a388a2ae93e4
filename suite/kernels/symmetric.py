"""Products of matrices that are known to be symmetric: half of the sums, and the same bits on both sides."""

from __future__ import annotations

from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.matrix import combined, multiply, transpose

SMALL = 8  # states up to which products are plain sums


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX))
def symmetric(A: Any, B: Any, C: Any) -> None:
    """C = A B, square and known to be symmetric: row by row up to the diagonal. Writes C, which is neither A nor B."""
    n = A.shape[0]
    for i in range(n):
        combined(A[i], B, i + 1, C[i])
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
