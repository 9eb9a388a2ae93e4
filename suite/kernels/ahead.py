"""What the samples after one say of its state, as information, and the smoother that it makes.

The information filter backwards (Fraser and Potter 1969), about the filter's own path: z = x - X has the quadratic form
z' L z / 2 - l' z of the samples that follow. At the end nothing is known; then
    over a channel:  L <- L + H' H / R,  l <- l + H' r / R,  r = y - h(X) to first order
    to the forecast: l <- l + L (X - X-)
    over a step:     L <- Phi' (L^-1 + Qd)^-1 Phi,  l <- Phi' (I + L Qd)^-1 l
and P_s = (P^-1 + L)^-1, x_s = X + P_s l. No first variance goes into L or l, however wide it is.
"""

from __future__ import annotations

from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.factored import WIDE, factor, informed, measured
from suite.kernels.matrix import multiply, transpose
from suite.kernels.symmetric import symmetric

# l, g, u, z (n,); L, A, B, U (n, n)
AHEAD_WORK = nb.types.Tuple((nb.VECTOR,) * 4 + (nb.MATRIX,) * 4)
FLAGS = nb.types.boolean


@compile_kernel(nb.types.void(nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.REAL, nb.VECTOR, nb.MATRIX))
def blurred(L: Any, l: Any, u: Any, q: float, g: Any, W: Any) -> None:
    """L <- (L^-1 + u q u')^-1 = L - g g' / s,  l <- l - g u'l / s,  g = L u, s = 1/q + u'g. Writes L, l, g, W."""
    n = u.shape[0]
    s = 1.0 / q
    along = 0.0
    for i in range(n):
        g[i] = 0.0
        for j in range(n):
            g[i] += L[i, j] * u[j]
        s += u[i] * g[i]
        along += u[i] * l[i]
    wide = s * q > WIDE or s * q < 1.0
    if wide:
        s = measured(L, u, 1.0 / q, 0.0, W, g)
    for i in range(n):
        l[i] -= g[i] * along / s
        if not wide:
            for j in range(n):
                L[i, j] -= g[i] * g[j] / s


@compile_kernel(
    nb.types.void(
        nb.CUBE, nb.CUBE, nb.CUBE, nb.CUBE, nb.MATRIX, FLAGS[:, ::1], nb.VECTOR, nb.MATRIX, nb.MATRIX, nb.CUBE,
        FLAGS[::1], AHEAD_WORK, nb.MATRIX, nb.CUBE, nb.MATRIX, nb.CUBE, nb.MATRIX,
    )
)  # fmt: skip
def ahead(
    Phi: Any, Qd: Any, H: Any, K: Any, nu: Any, seen: Any, R: Any, X: Any, Xp: Any, P: Any,
    asked: Any, work: Any, Xs: Any, Ps: Any, before: Any, Before: Any, after: Any,
) -> None:  # fmt: skip
    """Run backwards over one run, and write what `adjoint` does at the samples that are `asked` for, (N,); and work.

    Phi, Qd, P (N, n, n), H, K (N, outputs, n), nu (N, outputs), X, Xp (N, n) of a filter pass, seen (N, outputs): what
    was measured, R (outputs,). before, Before of a sample are written where the one before it is asked for.
    """
    l, g, u, z, L, A, B, U = work
    N, n = X.shape
    for i in range(n):
        l[i] = 0.0
        for j in range(n):
            L[i, j] = 0.0
    for k in range(N - 1, -1, -1):
        last = k == N - 1
        if not last:
            for i in range(n):
                for j in range(n):
                    l[i] += L[i, j] * (X[k + 1, j] - Xp[k + 1, j])
            factor(Qd[k + 1], U, 0.0)
            for j in range(n):
                if U[j, j] > 0.0:
                    for i in range(n):
                        u[i] = U[i, j] if i < j else (1.0 if i == j else 0.0)
                    blurred(L, l, u, U[j, j], g, A)
            if asked[k]:
                for i in range(n):
                    before[k + 1, i] = l[i]
                    for j in range(n):
                        Before[k + 1, i, j] = L[i, j]
            # l, L through the step; A = L Phi, B = Phi'.
            multiply(L, Phi[k + 1], A)
            transpose(Phi[k + 1], B)
            symmetric(B, A, L)
            for i in range(n):
                g[i] = 0.0
                for j in range(n):
                    g[i] += B[i, j] * l[j]
            for i in range(n):
                l[i] = g[i]
        if asked[k]:
            informed(P[k], L, U, B, Ps[k])
            for i in range(n):
                z[i] = 0.0
                for j in range(n):
                    z[i] += Ps[k, i, j] * l[j]
                Xs[k, i] = X[k, i] + z[i]
            for i in range(n):
                after[k, i] = l[i]
                for j in range(n):
                    after[k, i] -= L[i, j] * z[j]
            if not last:
                # lambda = l - L Phi z and Lambda = L - L Phi Ps Phi' L, of what was kept ahead of the step.
                for i in range(n):
                    for j in range(n):
                        before[k + 1, i] -= A[i, j] * z[j]
                multiply(A, Ps[k], U)
                for i in range(n):
                    for j in range(n):
                        for m in range(n):
                            Before[k + 1, i, j] -= U[i, m] * A[j, m]
        for i in range(n):
            z[i] = 0.0
        for c in range(H.shape[1] - 1, -1, -1):
            if not seen[k, c]:
                continue
            # z is how far the channels from this one on have moved the state.
            r = nu[k, c]
            for i in range(n):
                z[i] += K[k, c, i] * nu[k, c]
            for i in range(n):
                r -= H[k, c, i] * z[i]
            for i in range(n):
                l[i] += H[k, c, i] * r / R[c]
                for j in range(n):
                    L[i, j] += H[k, c, i] * H[k, c, j] / R[c]
