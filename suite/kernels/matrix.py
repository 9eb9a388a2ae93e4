"""Small dense matrices in scalar loops: solve, exponential, definiteness, and the flow of a Riccati equation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import speed

Array = npt.NDArray[np.float64]

# A, E, T1, T2 (2n, 2n); top, bottom (n, n); slope, total, trial (n, n)
FLOW_WORK = nb.types.Tuple((nb.MATRIX,) * 9)
MOST_PARTS = 20000


def flow_workspace(n: int) -> tuple[Array, ...]:
    """The scratch arrays of `transition_flow` and `integrated_flow`."""
    return (*(np.zeros((2 * n, 2 * n)) for _ in range(4)), *(np.zeros((n, n)) for _ in range(5)))


@compile_kernel(nb.INT(nb.MATRIX, nb.MATRIX))
def solve(A: Any, B: Any) -> int:
    """Solve A X = B with row pivoting; returns 0 where A is singular, else 1. Destroys A, writes X into B."""
    n = A.shape[0]
    m = B.shape[1]
    for j in range(n):
        pivot = j
        for i in range(j + 1, n):
            if abs(A[i, j]) > abs(A[pivot, j]):
                pivot = i
        if A[pivot, j] == 0.0 or not math.isfinite(A[pivot, j]):
            return 0
        if pivot != j:
            for l in range(n):
                A[j, l], A[pivot, l] = A[pivot, l], A[j, l]
            for l in range(m):
                B[j, l], B[pivot, l] = B[pivot, l], B[j, l]
        for i in range(j + 1, n):
            factor = A[i, j] / A[j, j]
            for l in range(j + 1, n):
                A[i, l] -= factor * A[j, l]
            for l in range(m):
                B[i, l] -= factor * B[j, l]
    for l in range(m):
        for i in range(n - 1, -1, -1):
            total = B[i, l]
            for j in range(i + 1, n):
                total -= A[i, j] * B[j, l]
            B[i, l] = total / A[i, i]
    return 1


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX))
def exponential(A: Any, E: Any, T1: Any, T2: Any) -> None:
    """E = exp(A) by Taylor's series of A / 2^k, squared k times. Writes E, T1, T2; destroys A."""
    n = A.shape[0]
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(A[i, j])
        norm = max(norm, row)
    if not norm < 1e6:  # the result would overflow; the caller finds NaN
        for i in range(n):
            for j in range(n):
                E[i, j] = math.nan
        return
    squarings = 0
    while norm > 0.5:
        norm *= 0.5
        squarings += 1
    scale = 0.5**squarings
    for i in range(n):
        for j in range(n):
            A[i, j] *= scale
            E[i, j] = 1.0 if i == j else 0.0
            T1[i, j] = E[i, j]
    for order in range(1, 18):
        largest = 0.0
        for i in range(n):
            for j in range(n):
                total = 0.0
                for l in range(n):
                    total += T1[i, l] * A[l, j]
                T2[i, j] = total / order
                largest = max(largest, abs(T2[i, j]))
        for i in range(n):
            for j in range(n):
                T1[i, j] = T2[i, j]
                E[i, j] += T1[i, j]
        if largest < 1e-18:
            break
    for _ in range(squarings):
        for i in range(n):
            for j in range(n):
                T1[i, j] = E[i, j]
        for i in range(n):
            for j in range(n):
                total = 0.0
                for l in range(n):
                    total += T1[i, l] * T1[l, j]
                E[i, j] = total


@compile_kernel(nb.INT(nb.MATRIX, nb.MATRIX))
def semidefinite(S: Any, L: Any) -> int:
    """1 where the symmetric S >= 0 within rounding (pivots of L D L'), else 0. Writes L."""
    n = S.shape[0]
    for j in range(n):
        for i in range(j, n):
            L[i, j] = S[i, j]
            for l in range(j):
                if L[l, l] > 0.0:
                    L[i, j] -= L[i, l] * L[j, l] / L[l, l]
        # What is left of a variance is compared with the variance itself: the same in any units of the states.
        if not L[j, j] >= -1e-6 * abs(S[j, j]):
            return 0
        if L[j, j] <= 1e-12 * abs(S[j, j]):
            L[j, j] = 0.0
    return 1


@compile_kernel(nb.INT(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.REAL, nb.MATRIX, nb.MATRIX, FLOW_WORK))
def transition_flow(F: Any, W: Any, B: Any, S: Any, h: float, half: Any, end: Any, work: Any) -> int:
    """S' = F S + S F' - S B S + W over h/2 and h, F, W, B held; returns 0 where it escapes, else 1.

    Raol (2016) (51)-(55): [a; b]' = [[F, W], [B, -F']] [a; b], S = a b^-1. Writes half, end (n, n) and work.
    """
    A, E, T1, T2, top, bottom = work[0], work[1], work[2], work[3], work[4], work[5]
    n = F.shape[0]
    source = 0.0
    quadratic = 0.0
    for i in range(n):
        for j in range(n):
            source = max(source, abs(W[i, j]))
            quadratic = max(quadratic, abs(B[i, j]))
    # S / c balances the two off-diagonal blocks, so that the exponential needs few squarings.
    c = math.sqrt(source / quadratic) if source > 0.0 and quadratic > 0.0 else 1.0
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.5 * h * F[i, j]
            A[i, n + j] = 0.5 * h * W[i, j] / c
            A[n + i, j] = 0.5 * h * B[i, j] * c
            A[n + i, n + j] = -0.5 * h * F[j, i]
    exponential(A, E, T1, T2)
    for part in range(2):
        before = S if part == 0 else half
        after = half if part == 0 else end
        # a = E11 S + E12, b = E21 S + E22; stored transposed: b' S' = a'
        for i in range(n):
            for j in range(n):
                a = E[i, n + j]
                b = E[n + i, n + j]
                for l in range(n):
                    a += E[i, l] * before[l, j] / c
                    b += E[n + i, l] * before[l, j] / c
                top[j, i] = a
                bottom[j, i] = b
        if solve(bottom, top) == 0:
            return 0
        for i in range(n):
            for j in range(i + 1):
                after[i, j] = 0.5 * c * (top[i, j] + top[j, i])
                after[j, i] = after[i, j]
                if not math.isfinite(after[i, j]):
                    return 0
    return 1


@compile_kernel(nb.INT(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.REAL, nb.MATRIX, nb.MATRIX, FLOW_WORK))
def integrated_flow(F: Any, W: Any, B: Any, S: Any, h: float, half: Any, end: Any, work: Any) -> int:
    """The same as `transition_flow` by RK4, in parts as small as the stiffness asks. Writes half, end and work."""
    slope, total, trial, now = work[6], work[7], work[8], work[4]
    n = F.shape[0]
    for i in range(n):
        for j in range(n):
            now[i, j] = S[i, j]
    rate = 2.0 * speed(F)
    for side in range(2):
        done = 0.0
        parts = 0
        while done < 0.5 * h * (1.0 - 1e-12):
            stiffness = rate
            for i in range(n):
                for j in range(n):
                    stiffness += 2.0 * abs(now[i, j] * B[j, i])
            left = 0.5 * h - done
            part = left / math.ceil(max(1.0, left * stiffness / 0.2))
            parts += 1
            if parts > MOST_PARTS or not math.isfinite(part):
                return 0
            for stage in range(4):
                offset = 0.0 if stage == 0 else (part if stage == 3 else 0.5 * part)
                for i in range(n):
                    for j in range(n):
                        trial[i, j] = now[i, j] if stage == 0 else now[i, j] + offset * slope[i, j]
                for i in range(n):
                    for j in range(n):
                        value = W[i, j]
                        for l in range(n):
                            value += F[i, l] * trial[l, j] + trial[i, l] * F[j, l]
                            for m in range(n):
                                value -= trial[i, l] * B[l, m] * trial[m, j]
                        slope[i, j] = value
                weight = 1.0 if stage == 0 or stage == 3 else 2.0
                for i in range(n):
                    for j in range(n):
                        total[i, j] = slope[i, j] if stage == 0 else total[i, j] + weight * slope[i, j]
            for i in range(n):
                for j in range(n):
                    now[i, j] += part / 6.0 * total[i, j]
                    if not math.isfinite(now[i, j]):
                        return 0
            done += part
        for i in range(n):
            for j in range(n):
                if side == 0:
                    half[i, j] = 0.5 * (now[i, j] + now[j, i])
                else:
                    end[i, j] = 0.5 * (now[i, j] + now[j, i])
    return 1
