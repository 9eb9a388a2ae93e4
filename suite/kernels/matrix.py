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

# A, E, A2, A3, A4, T (2n, 2n); top, bottom (n, n); slope, total, trial (n, n)
FLOW_WORK = nb.types.Tuple((nb.MATRIX,) * 11)
MOST_PARTS = 20000


def flow_workspace(n: int) -> tuple[Array, ...]:
    """The scratch arrays of `transition_flow` and `integrated_flow`."""
    return (*(np.zeros((2 * n, 2 * n)) for _ in range(6)), *(np.zeros((n, n)) for _ in range(5)))


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
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            for l in range(m):
                B[i, l] -= A[i, j] * B[j, l]
        for l in range(m):
            B[i, l] /= A[i, i]
    return 1


@compile_kernel(nb.types.void(nb.VECTOR, nb.MATRIX, nb.INT, nb.VECTOR))
def combined(a: Any, B: Any, width: int, c: Any) -> None:
    """c = a B in its first `width` numbers, four rows of B at a time: the inner loop runs along memory. Writes c."""
    inner = B.shape[0]
    whole = inner - inner % 4
    for j in range(width):
        c[j] = 0.0
    for l in range(0, whole, 4):
        a0, a1, a2, a3 = a[l], a[l + 1], a[l + 2], a[l + 3]
        if a0 != 0.0 or a1 != 0.0 or a2 != 0.0 or a3 != 0.0:
            for j in range(width):
                c[j] += a0 * B[l, j] + a1 * B[l + 1, j] + a2 * B[l + 2, j] + a3 * B[l + 3, j]
    for l in range(whole, inner):
        for j in range(width):
            c[j] += a[l] * B[l, j]


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX))
def multiply(A: Any, B: Any, C: Any) -> None:
    """C = A B. Writes C, which is neither A nor B."""
    for i in range(A.shape[0]):
        combined(A[i], B, B.shape[1], C[i])


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX))
def transpose(A: Any, T: Any) -> None:
    """T = A'. Writes T, which is not A."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            T[j, i] = A[i, j]


@compile_kernel(nb.REAL(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX))
def fastest(A: Any, B: Any, M: Any, T: Any) -> float:
    """A bound of the largest eigenvalue in size of A B, A symmetric and B >= 0: those eigenvalues are real, so it is
    tr((A B)^8)^(1/8), which n equal ones exceed by n^(1/8); the same in any units of the states. Writes M, T.
    """
    n = A.shape[0]
    bound = 1.0
    power = 1.0
    multiply(A, B, M)
    for _ in range(3):
        trace = 0.0
        for i in range(n):
            for j in range(n):
                trace += M[i, j] * M[j, i]
        if trace <= 0.0 or not math.isfinite(trace):
            return 0.0 if trace <= 0.0 else math.inf
        scale = math.sqrt(trace)
        bound *= scale**power
        power *= 0.5
        for i in range(n):
            for j in range(n):
                M[i, j] /= scale
        multiply(M, M, T)
        for i in range(n):
            for j in range(n):
                M[i, j] = T[i, j]
    trace = 0.0
    for i in range(n):
        trace += M[i, i]
    return float(bound * max(trace, 0.0) ** power)


@compile_kernel(nb.types.void(nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX, nb.MATRIX))
def exponential(A: Any, E: Any, A2: Any, A3: Any, A4: Any, T: Any) -> None:
    """E = exp(A) by Taylor's series of A / 2^k, squared k times. Writes E, A2, A3, A4, T; destroys A.

    The series is taken to order 15, four orders at a time (Paterson and Stockmeyer 1973): six products.
    """
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
            E[i, j] = 0.0
    multiply(A, A, A2)
    multiply(A2, A, A3)
    multiply(A2, A2, A4)
    # c A^0 + c/(k+1) A + ... : the orders k to k + 3, on top of what the higher ones left, times A^4.
    for block in range(3, -1, -1):
        multiply(E, A4, T)
        c0 = 1.0
        for order in range(1, 4 * block + 1):
            c0 /= order
        c1 = c0 / (4 * block + 1)
        c2 = c1 / (4 * block + 2)
        c3 = c2 / (4 * block + 3)
        for i in range(n):
            for j in range(n):
                E[i, j] = T[i, j] + c1 * A[i, j] + c2 * A2[i, j] + c3 * A3[i, j]
            E[i, i] += c0
    for _ in range(squarings):
        multiply(E, E, T)
        for i in range(n):
            for j in range(n):
                E[i, j] = T[i, j]


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
    A, E, A2, A3, A4, T, top, bottom = work[0], work[1], work[2], work[3], work[4], work[5], work[6], work[7]
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
    exponential(A, E, A2, A3, A4, T)
    # E11' and E21' beside each other, so that the loops below run along memory.
    for i in range(n):
        for j in range(n):
            T[i, j] = E[j, i]
            T[i, n + j] = E[n + j, i]
    for part in range(2):
        before = S if part == 0 else half
        after = half if part == 0 else end
        # a = E11 S + E12, b = E21 S + E22; transposed, b' S' = a'
        for i in range(n):
            for j in range(n):
                top[i, j] = E[j, n + i]
                bottom[i, j] = E[n + j, n + i]
            for l in range(n):
                share = before[l, i] / c
                if share != 0.0:
                    for j in range(n):
                        top[i, j] += share * T[l, j]
                        bottom[i, j] += share * T[l, n + j]
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
    slope, total, trial, now = work[8], work[9], work[10], work[6]
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
