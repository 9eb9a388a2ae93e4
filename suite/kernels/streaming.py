"""One sample of the extended Kalman filter, for measurements that arrive one at a time.

A filter is two vectors: to hand over twenty arrays costs more than the sample itself.
`whole` (integers): the entries named below, then the gates' switches. `real` (numbers), each part after the other:
    x (n), P (n n), e (outputs), t (2), u (2 inputs), y (2 outputs), linear (inputs), p (parameters), Q (n n),
    R (outputs), angle (outputs), then room to work in.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba.core import cgutils
from numba.extending import intrinsic

from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.kalman import ekf

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

# Entries of `whole`: the addresses of the model's own step and functions, four sizes, 1 where the filter was lost.
STEP, RATE, OUTPUT, STATES, INPUTS, OUTPUTS, PARAMETERS, LOST, GATES = range(9)


def packed(
    addresses: tuple[int, int, int], gates: Whole, x: Array, P: Array, linear: Array, p: Array, Q: Array, R: Array,
    angle: Array,
) -> tuple[Whole, Array]:  # fmt: skip
    """`whole` and `real` of a filter that has not seen a sample: x (n,), P, Q (n, n), R, angle (outputs,)."""
    n, inputs, outputs, parameters = len(x), len(linear), len(R), len(p)
    whole = np.array([*addresses, n, inputs, outputs, parameters, 0, *gates], dtype=np.int64)
    missing = np.full(outputs, np.nan)
    memory = np.full(2, np.nan), np.zeros(2 * inputs), missing, missing
    fixed = linear, p, np.ravel(Q), R, angle
    room = np.zeros(15 * n * n + 9 * n + inputs + outputs * (4 * n + 5 + parameters) + n * parameters)
    return whole, np.concatenate([x, np.ravel(P), missing, *memory, *fixed, room])


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


@compile_kernel(nb.types.void(nb.INDICES, nb.VECTOR, nb.REAL, nb.VECTOR, nb.VECTOR))
def next_sample(whole: Any, real: Any, now: float, u_now: Any, y_now: Any) -> None:
    """Move x, P to the sample at time `now` and update them by it: u_now (inputs,), y_now (outputs,; NaN is missing).

    t, u and y hold the last two samples, the first of y always NaN, for it is in x, P already; t starts as NaN, and the
    first sample updates x, P alone. `ekf` with `spread` noise runs over the two. Writes `real`: x, P, and e, the
    innovations over their sd, NaN where missing. Where a number is not finite x, P stay, `whole[LOST]` becomes 1, and
    from the next sample on the innovations are infinite.
    """
    n = whole[STATES]
    nu = whole[INPUTS]
    ny = whole[OUTPUTS]
    m = whole[PARAMETERS]
    nn = n * n
    x = real[0:n]
    C = real[n : n + nn].reshape((n, n))
    at = n + nn
    e = real[at : at + ny]
    if whole[LOST] != 0:
        for c in range(ny):
            e[c] = math.nan if math.isnan(y_now[c]) else math.inf
        return
    at += ny
    t = real[at : at + 2]
    at += 2
    u = real[at : at + 2 * nu].reshape((2, nu))
    at += 2 * nu
    y = real[at : at + 2 * ny].reshape((2, ny))
    at += 2 * ny
    linear = real[at : at + nu]
    at += nu
    p = real[at : at + m]
    at += m
    Q = real[at : at + nn].reshape((n, n))
    at += nn
    R = real[at : at + ny]
    at += ny
    angle = real[at : at + ny]
    at += ny
    squares = real[at : at + 15 * nn].reshape((15, n, n))
    at += 15 * nn
    rows = real[at : at + 9 * n].reshape((9, n))
    at += 9 * n
    us = real[at : at + nu]
    at += nu
    channels = real[at : at + 4 * ny * n].reshape((2, 2, ny, n))
    at += 4 * ny * n
    seen = real[at : at + 4 * ny].reshape((2, 2, ny))
    at += 4 * ny
    yv = real[at : at + ny]
    at += ny
    Hp = real[at : at + ny * m].reshape((ny, m))
    at += ny * m
    Fp = real[at : at + n * m].reshape((n, m))

    first = math.isnan(t[1])
    t[0] = now if first else t[1]
    t[1] = now
    for i in range(nu):
        u[0, i] = u_now[i] if first else u[1, i]
        u[1, i] = u_now[i]
    for c in range(ny):
        y[1, c] = y_now[c]
    work = rows[0], rows[1], rows[2], us, squares[0], Fp, squares[1], squares[2], squares[3]
    own = Hp, rows[3], rows[4], squares[4], yv
    X = rows[5:7]
    Xp = rows[7:9]
    P = squares[7:9]
    failed = ekf(
        whole[STEP], _at(whole[RATE]), _at(whole[OUTPUT]), t, u, linear, y, Xp, Xp, 0, x, C, p, whole[GATES:], Q, 1, R,
        angle, whole[0:0], work, own, X, P, Xp, squares[9:11], squares[11:13], squares[13:15], channels[0], channels[1],
        seen[0], seen[1],
    )  # fmt: skip
    for c in range(ny):
        e[c] = math.nan if math.isnan(y[1, c]) else seen[0, 1, c] / math.sqrt(seen[1, 1, c])
    if failed >= 0:
        whole[LOST] = 1
        return
    for i in range(n):
        x[i] = X[1, i]
        for j in range(n):
            C[i, j] = P[1, i, j]
