"""A covariance by its factors, U D U' with U unit upper triangular: positive whatever is subtracted (Bierman 1977).

P - K s K' loses its digits where the prior is many times wider than the sensor. By factors D is only multiplied by
numbers between 0 and 1.
"""

from __future__ import annotations

import math
from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel

WIDE = 1e8  # an innovation's variance over its sensor's, from which on half of the digits are lost
ROUNDING = 1e-15  # of a variance, a state: what the products that a forecast is made of may be off


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.REAL))
def factor(P: Any, U: Any, least: float) -> None:
    """Write U with D in place of its diagonal of ones, each at least `least` of the variance and never below zero.

    What a narrow direction of a wide P was is lost in rounding. With `least` at n ROUNDING it counts as unknown to that
    extent, and what was known there is forgotten; with 0 it may count as known.
    """
    n = P.shape[0]
    for j in range(n - 1, -1, -1):
        pivot = P[j, j]
        for l in range(j + 1, n):
            pivot -= U[l, l] * U[j, l] * U[j, l]
        pivot = max(pivot, least * P[j, j], 0.0)
        U[j, j] = pivot
        for i in range(j):
            total = P[i, j]
            for l in range(j + 1, n):
                total -= U[l, l] * U[i, l] * U[j, l]
            U[i, j] = total / pivot if pivot > 0.0 else 0.0
            U[j, i] = 0.0


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX))
def product(U: Any, P: Any) -> None:
    """P = U D U' of what `factor` writes, symmetric. Writes P."""
    n = U.shape[0]
    for i in range(n):
        for j in range(i + 1):
            # The ones of the diagonal are not stored.
            total = U[i, i] if i == j else U[j, i] * U[i, i]
            for l in range(i + 1, n):
                total += U[i, l] * U[l, l] * U[j, l]
            P[i, j] = total
            P[j, i] = total


@compile_kernel(nb.REAL(nb.MATRIX, nb.VECTOR, nb.REAL, nb.REAL, nb.MATRIX, nb.VECTOR))
def measured(P: Any, h: Any, R: float, least: float, U: Any, gain: Any) -> float:
    """P <- P - K s K' of one channel, gain <- P h' = K s; returns s = h P h' + R. Bierman (1977), V.3. Writes U.

    U goes through column by column: D_j shrinks by alpha_(j-1) / alpha_j, alpha_j the variance of what the first j
    factors bring and of the sensor.
    """
    n = P.shape[0]
    factor(P, U, least)
    alpha = R
    for j in range(n):
        f = h[j]
        for l in range(j):
            f += U[l, j] * h[l]
        v = U[j, j] * f
        before = alpha
        alpha += v * f
        if alpha > 0.0:
            U[j, j] *= before / alpha
        gain[j] = v
        for i in range(j):
            old = U[i, j]
            if before > 0.0:
                U[i, j] -= gain[i] * f / before
            gain[i] += old * v
    product(U, P)
    return alpha


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX))
def informed(P: Any, L: Any, U: Any, M: Any, out: Any) -> None:
    """(P^-1 + L)^-1 = S (I + S' L S)^-1 S' of P = S S' >= 0 and an information L >= 0, symmetric. Writes U, M, out."""
    n = P.shape[0]
    factor(P, U, n * ROUNDING)
    for j in range(n):
        root = math.sqrt(U[j, j])
        for i in range(j):
            U[i, j] *= root
        U[j, j] = root
    # out = L S, M = I + S' (L S), U is S.
    for i in range(n):
        for j in range(n):
            total = 0.0
            for l in range(j + 1):
                total += L[i, l] * U[l, j]
            out[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = 1.0 if i == j else 0.0
            for l in range(i + 1):
                total += U[l, i] * out[l, j]
            M[i, j] = total
    # M = G G', G over M; then S <- S G'^-1 row by row.
    for j in range(n):
        for l in range(j):
            for i in range(j, n):
                M[i, j] -= M[i, l] * M[j, l]
        root = math.sqrt(max(M[j, j], 1.0))
        for i in range(j, n):
            M[i, j] = root if i == j else M[i, j] / root
    for i in range(n):
        for j in range(n):
            total = U[i, j]
            for l in range(j):
                total -= out[i, l] * M[j, l]
            out[i, j] = total / M[j, j]
    for i in range(n):
        for j in range(n):
            U[i, j] = out[i, j]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for l in range(n):
                total += U[i, l] * U[j, l]
            out[i, j] = total
            out[j, i] = total
