"""The true plant's states and its model error at the samples, in one compiled loop."""

from __future__ import annotations

from typing import Any

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.integrate import WORK, advance

# Parts a sample is cut into at least: the truth is much finer than any estimator's own integration.
FINE = 20


@compile_kernel(
    nb.types.void(
        nb.MODEL, nb.VECTOR, nb.MODEL, nb.VECTOR, nb.MODEL, nb.VECTOR, nb.INT,
        nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.INDICES, nb.MATRIX, nb.MATRIX, nb.MATRIX, WORK,
    )
)  # fmt: skip
def trajectory(
    truth: Any, p: Any, model: Any, q: Any, mover: Any, r: Any, held: int,
    t: Any, u: Any, linear: Any, none: Any, X: Any, D: Any, T: Any, work: Any,
) -> None:  # fmt: skip
    """X (N, n), whose first row is given, and D (N, n) = truth - model; `mover` carries the state over each sample.

    With `held` the last n of the mover's parameters r are the push, set to D[k] at each sample.
    Writes X, D, T, r, work.
    """
    f, _, g, _, Fx, Fp, _, _, _ = work
    n = X.shape[1]
    for k in range(t.shape[0]):
        truth(t[k], X[k], u[k], p, none, f, Fx, Fp)
        model(t[k], X[k], u[k], q, none, g, Fx, Fp)
        for i in range(n):
            D[k, i] = f[i] - g[i]
            if held != 0:
                r[r.shape[0] - n + i] = D[k, i]
        if k + 1 < t.shape[0]:
            for i in range(n):
                X[k + 1, i] = X[k, i]
            advance(mover, t[k], t[k + 1] - t[k], u[k], u[k + 1], linear, r, none, none, FINE, X[k + 1], T, work)
