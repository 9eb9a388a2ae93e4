"""One sample of the extended Kalman filter, for measurements that arrive one at a time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.core import cgutils
from numba.extending import intrinsic

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.kalman import ekf


def _function(typing_context: Any, address: Any) -> Any:
    """The model's function at an address. To hand it over as a function costs more than the sample itself."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = cgutils.create_struct_proxy(nb.MODEL)(context, builder)
        # The first field is the C function's address, whatever the version of numba calls it; the others stay empty.
        first, *others = context.data_model_manager[nb.MODEL]._fields
        for name in others:
            setattr(function, name, cgutils.get_null_value(getattr(function, name).type))
        setattr(function, first, builder.inttoptr(arguments[0], getattr(function, first).type))
        return function._getvalue()

    return nb.MODEL(nb.INT), generate


_at: Any = intrinsic(_function)


@compile_kernel(
    nb.INT(
        nb.INT, nb.INT, nb.REAL, nb.VECTOR, nb.VECTOR, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX,
        nb.VECTOR, nb.INDICES, nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.VECTOR,
    )
)  # fmt: skip
def next_sample(
    rate_at: int, output_at: int, now: float, u_now: Any, y_now: Any, t: Any, u: Any, linear: Any, y: Any,
    x: Any, C: Any, p: Any, on: Any, Q: Any, R: Any, angle: Any, e: Any,
) -> int:  # fmt: skip
    """Move x, C to the sample at time `now` and update them by it; returns 0 where a number is not finite, else 1.

    u_now (inputs,), y_now (outputs,; NaN is missing). t (2,), u (2, inputs), y (2, outputs) hold the last two samples,
    the first of y always NaN, for it is in x, C already; t starts as NaN, and the first sample updates x, C alone. The
    other arguments are those of `ekf` with `spread` noise, which runs here over the two. Writes t, u, y, e (outputs,),
    the innovations over their sd, NaN where missing, and x (n,), C (n, n), which stay where a number is not finite.
    """
    first = math.isnan(t[1])
    t[0] = now if first else t[1]
    t[1] = now
    for i in range(u.shape[1]):
        u[0, i] = u_now[i] if first else u[1, i]
        u[1, i] = u_now[i]
    for c in range(y.shape[1]):
        y[1, c] = y_now[c]
    n = x.shape[0]
    ny = R.shape[0]
    m = p.shape[0]
    X = np.zeros((2, n))
    P = np.zeros((2, n, n))
    scratch = np.zeros((4, 2, n, n))
    channels = np.zeros((2, 2, ny, n))
    seen = np.zeros((2, 2, ny))
    work = (
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(u.shape[1]), np.zeros((n, n)), np.zeros((n, m)),
        np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)),
    )  # fmt: skip
    own = (
        np.zeros((ny, m)), np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(ny),
    )  # fmt: skip
    Xp = np.zeros((2, n))
    failed = ekf(
        _at(rate_at), _at(output_at), t, u, linear, y, Xp, Xp, 0, x, C, p, on, Q, 1, R, angle,
        np.zeros(0, dtype=np.int64), work, own, X, P, Xp, scratch[0], scratch[1], scratch[2], channels[0], channels[1],
        seen[0], seen[1],
    )  # fmt: skip
    for c in range(ny):
        e[c] = math.nan if math.isnan(y[1, c]) else seen[0, 1, c] / math.sqrt(seen[1, 1, c])
    if failed >= 0:
        return 0
    for i in range(n):
        x[i] = X[1, i]
        for j in range(n):
            C[i, j] = P[1, i, j]
    return 1


@compile_kernel(nb.types.void(nb.REAL, nb.VECTOR, nb.INT, nb.REAL, nb.VECTOR, nb.MATRIX))
def forget(grow: float, most: Any, states: int, spread: float, x: Any, C: Any) -> None:
    """C of x (n,) times `grow`, each variance up to `most` (n,) and never less than it was. Writes C and most.

    `most` of the first `states` is raised to spread^2 times their square.
    """
    n = x.shape[0]
    for i in range(n):
        if i < states:
            most[i] = max(most[i], (spread * x[i]) ** 2)
        factor = min(grow, max(1.0, most[i] / C[i, i])) if C[i, i] > 0.0 else 1.0
        root = math.sqrt(factor)
        # Once by its row and once by its column: the variance by the factor itself.
        for j in range(n):
            C[i, j] *= root
        for j in range(n):
            C[j, i] *= root
