"""The one-step-ahead output prediction of the predictive filter: Lie derivatives by sympy, and the compiled pass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from suite.expressions import TIME, symbol
from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel
from suite.kernels.codegen import Program, compile_program
from suite.kernels.integrate import WORK, advance, workspace
from suite.kernels.matrix import solve
from suite.kernels.slopes import Slopes
from suite.kernels.types import arrays
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Beyond this a state is lost, whatever its unit.
LOST = 1e100


@dataclass(frozen=True)
class Prediction:
    """What the outputs' expansion needs.

    `program` has the outputs h, L_f h ... L_f^(p-1) h of each channel and behind them the part of L_f^p h that is not
    its gradient along f (time and inputs). first (outputs,): a channel's first row; degree (outputs,): p, the order
    of the first derivative in which a model error appears, 0 where none does. Its inputs are u and the rates of u.
    """

    program: Program
    first: Indices
    degree: Indices


def prediction(model: Model) -> Prediction:
    """The Lie derivatives of the outputs along the model's rates, up to each one's relative degree to the suspects."""
    names = (tuple(model.states), tuple(model.inputs), tuple(model.parameters))
    return _prediction(names, model.suspects, model.rates, model.output_expressions)


@lru_cache(maxsize=64)
def _prediction(
    names: tuple[tuple[str, ...], ...], suspects: tuple[str, ...],
    rates: tuple[sympy.Expr, ...], outputs: tuple[sympy.Expr, ...],
) -> Prediction:  # fmt: skip
    states, inputs, parameters = names
    slope = Slopes().of
    moved = [f"{name}_rate" for name in inputs]
    while set(moved) & {*states, *inputs, *parameters}:
        moved = [f"{name}_" for name in moved]
    rows: list[sympy.Expr] = []
    first, degree = [], []
    for h in outputs:
        first.append(len(rows))
        lie, found = h, 0
        for order in range(1, len(states) + 1):
            rows.append(lie)
            gradient = {name: slope(lie, symbol(name)) for name in states}
            # What does not come from the states: L_f takes the partial derivatives by t and, along a line, by u.
            beside = slope(lie, symbol(TIME)) + sum(
                (slope(lie, symbol(u)) * symbol(rate) for u, rate in zip(inputs, moved, strict=True)), sympy.Integer(0)
            )
            if any(gradient[name] != 0 for name in suspects):
                rows.append(beside)
                found = order
                break
            lie = beside + sum((gradient[n] * f for n, f in zip(states, rates, strict=True)), sympy.Integer(0))
            if lie == 0:
                break
        degree.append(found)
    program = compile_program(
        states=states, inputs=(*inputs, *moved), parameters=parameters, rates=rates, outputs=tuple(rows)
    )
    return Prediction(program, np.array(first, dtype=np.int64), np.array(degree, dtype=np.int64))


# f (n,), value (rows,), wide (2 inputs,), grown (n + m,); Fx (n, n), Fp (n, parameters), Hx (rows, n),
# Hp (rows, parameters), T (n + m, n + m), A (m, m), b (m, 1)
PREDICTIVE_WORK = nb.types.Tuple((nb.VECTOR,) * 4 + (nb.MATRIX,) * 7)


@compile_kernel(
    nb.INT(
        nb.MODEL, nb.MODEL, nb.MODEL, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.MATRIX, nb.VECTOR, nb.VECTOR, nb.INDICES,
        nb.INDICES, nb.INDICES, nb.INDICES, nb.INDICES, nb.VECTOR, nb.VECTOR, nb.VECTOR, WORK, PREDICTIVE_WORK,
        nb.MATRIX, nb.MATRIX, nb.MATRIX,
    )
)  # fmt: skip
def predictive_pass(
    rate: Any, expansion: Any, driven: Any, t: Any, u: Any, linear: Any, y: Any, x0: Any, p: Any, on: Any,
    none: Any, at: Any, first: Any, degree: Any, spread: Any, R: Any, angle: Any, advance_work: Any, work: Any,
    X: Any, D: Any, Y: Any,
) -> int:  # fmt: skip
    """d = ([Lam S]' R^-1 [Lam S] + W)^-1 [Lam S]' R^-1 (y(t + dt) - yhat(t) - z), held over the step that it predicts.

    z_i = sum_(k=1)^(p_i) dt^k / k! L_f^k h_i,  Lam_ii = dt^(p_i) / p_i!,  S_i = L_g L_f^(p_i - 1) h_i;
    W = dt / spread, spread (m,) the density of d; at (m,) the suspects' places. `driven` are the rates of [x, d].
    Writes X, D (N, n), Y (N, outputs): outputs of X; returns -1, or the sample at which a state left every bound.
    """
    f, value, wide, grown, Fx, Fp, Hx, Hp, T, A, b = work
    n = x0.shape[0]
    m = at.shape[0]
    N = t.shape[0]
    inputs = u.shape[1]
    for i in range(n):
        X[0, i] = x0[i]
    for k in range(N):
        last = k == N - 1
        dt = 1.0 if last else t[k + 1] - t[k]
        for i in range(inputs):
            wide[i] = u[k, i]
            wide[inputs + i] = 0.0 if last else linear[i] * (u[k + 1, i] - u[k, i]) / dt
        rate(t[k], X[k], wide, p, on, f, Fx, Fp)
        expansion(t[k], X[k], wide, p, on, value, Hx, Hp)
        for c in range(y.shape[1]):
            Y[k, c] = value[first[c]]
        if last:
            break
        # In d / sqrt(spread / dt), whose weight is one, so that a suspect without density has d = 0.
        for i in range(m):
            b[i, 0] = 0.0
            for j in range(m):
                A[i, j] = 1.0 if i == j else 0.0
        for c in range(y.shape[1]):
            if degree[c] == 0 or math.isnan(y[k + 1, c]):
                continue
            top = first[c] + degree[c] - 1
            e = y[k + 1, c] - value[first[c]]
            factor = 1.0
            for order in range(1, degree[c]):
                factor *= dt / order
                e -= factor * value[first[c] + order]
            factor *= dt / degree[c]
            e -= factor * value[top + 1]
            for i in range(n):
                e -= factor * Hx[top, i] * f[i]
            if angle[c] > 0.0:
                e = math.atan2(math.sin(e), math.cos(e))
            for i in range(m):
                row = factor * Hx[top, at[i]] * math.sqrt(spread[i] / dt)
                b[i, 0] += row * e / R[c]
                for j in range(m):
                    A[i, j] += row * factor * Hx[top, at[j]] * math.sqrt(spread[j] / dt) / R[c]
        if solve(A, b) == 0:
            return k + 1
        for i in range(n):
            grown[i] = X[k, i]
            D[k + 1, i] = 0.0
        for i in range(m):
            grown[n + i] = b[i, 0] * math.sqrt(spread[i] / dt)
            D[k + 1, at[i]] = grown[n + i]
        advance(driven, t[k], dt, u[k], u[k + 1], linear, p, on, none, 1, grown, T, advance_work)
        for i in range(n):
            if not abs(grown[i]) < LOST:
                return k + 1
            X[k + 1, i] = grown[i]
    return -1


def predicted(
    model: Model, record: Record, x0: Array, spread: Array, R: Array
) -> tuple[Array, Array, Array, int | None]:
    """The predictive filter over one run: x, d (N, n), outputs (N, outputs), and the sample at which it failed or None.

    spread (m,): density of each suspect's d, its weight W is dt / spread; R (outputs,): variance of a sample.
    """
    lie, program = prediction(model), model.program
    driven = model.with_disturbance(model.suspects).program
    at = np.array([list(model.states).index(name) for name in model.suspects], dtype=np.int64)
    n, m, N, rows, parameters = program.n, len(at), len(record), lie.program.outputs_count, program.parameters
    X, D, Y = np.zeros((N, n)), np.zeros((N, n)), np.zeros((N, len(lie.first)))
    vectors = (np.zeros(n), np.zeros(rows), np.zeros(2 * program.inputs), np.zeros(n + m))
    slopes = (np.zeros((n, n)), np.zeros((n, parameters)), np.zeros((rows, n)), np.zeros((rows, parameters)))
    own = (*vectors, *slopes, np.zeros((n + m, n + m)), np.zeros((m, m)), np.zeros((m, 1)))
    failed = predictive_pass(
        program.rate, lie.program.output, driven.rate, *arrays(record.t, record.u), model.linear_inputs,
        *arrays(record.y, x0), model.values, program.all_off(), np.zeros(0, dtype=np.int64), at, lie.first, lie.degree,
        *arrays(spread, R), model.angles, workspace(n + m, program.inputs, parameters, 0), own, X, D, Y,
    )  # fmt: skip
    return X, D, Y, None if failed < 0 else int(failed)
