"""The window of moving-horizon estimation as a CasADi program: the model's equations translated, multiple shooting."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from suite.expressions import TIME, symbol
from suite.kernels.integrate import REACH, speed
from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# IPOPT's stop; the variables are in units of their own standard deviations.
TOLERANCE, ROUNDS = 1e-9, 100
MOST_SUBSTEPS = 64


def translated(expression: sympy.Expr, names: Mapping[sympy.Symbol, Any], casadi: Any) -> Any:
    """A model's expression as CasADi's, `names` giving each symbol's."""
    e: Any = expression
    if e.is_Symbol:
        return names[e]
    if e.is_number:
        return float(e)
    parts = [translated(part, names, casadi) for part in e.args]
    if e.is_Add:
        return reduce(lambda a, b: a + b, parts)
    if e.is_Mul:
        return reduce(lambda a, b: a * b, parts)
    if e.is_Pow:
        return casadi.sqrt(parts[0]) if e.exp == sympy.Rational(1, 2) else parts[0] ** parts[1]
    if e.func in (sympy.Min, sympy.Max):
        return reduce(casadi.fmin if e.func is sympy.Min else casadi.fmax, parts)
    # The other functions have one name in both.
    return casadi.fabs(*parts) if e.func is sympy.Abs else getattr(casadi, e.func.__name__)(*parts)


@dataclass(frozen=True)
class Window:
    """The compiled window: `solver`, CasADi's; M steps of n states, q of which have noise, and the place of these."""

    solver: Any
    steps: int
    n: int
    noisy: npt.NDArray[np.int64]


def window(model: Model, prior: Prior, steps: int, substeps: int) -> Window:
    """The least-squares problem of a window of `steps` steps, its data left as parameters.

    Unknown: a (n,), w (q, steps), x_1 ... x_steps (n,), with x_0 = xbar + S a, S S' = Pbar, which allows a singular
    Pbar; x_(k+1) = F_k(x_k) + sqrt(Q dt) w_k, F_k `substeps` steps of RK4. Minimised: a'a + sum w'w
    + sum seen (y - h(x_k))^2 / R. A step with dt = 0 changes nothing: so a shorter window is a special case.
    """
    # Optional, and imported where it is used: the plug-in loads without it.
    casadi: Any = importlib.import_module("casadi")
    n, nu, ny = len(model.states), len(model.inputs), len(model.outputs)
    noisy = np.flatnonzero(prior.Q > 0.0)
    rate, output = _functions(model, casadi)
    x, t, dt = casadi.SX.sym("x", n), casadi.SX.sym("t"), casadi.SX.sym("dt")
    u0, u1 = casadi.SX.sym("u0", nu), casadi.SX.sym("u1", nu)
    moved = x
    for part in range(substeps):
        h = dt / substeps
        stages: list[Any] = []
        for offset in (0.0, 0.5, 0.5, 1.0):
            share = (part + offset) / substeps
            at = moved + offset * h * stages[-1] if stages else moved
            stages.append(rate(t + share * dt, at, u0 + model.linear_inputs * share * (u1 - u0)))
        moved = moved + h / 6.0 * (stages[0] + 2.0 * stages[1] + 2.0 * stages[2] + stages[3])
    move = casadi.Function("move", [t, x, u0, u1, dt], [moved])

    a, w, X = casadi.MX.sym("a", n), casadi.MX.sym("w", len(noisy), steps), casadi.MX.sym("X", n, steps)
    mean, S = casadi.MX.sym("mean", n), casadi.MX.sym("S", n, n)
    T, U = casadi.MX.sym("T", steps + 1), casadi.MX.sym("U", nu, steps + 1)
    Y, seen = casadi.MX.sym("Y", ny, steps + 1), casadi.MX.sym("seen", ny, steps + 1)
    path = casadi.horzcat(mean + S @ a, X)
    cost = casadi.sumsqr(a) + casadi.sumsqr(w)
    gaps = []
    for k in range(steps + 1):
        e = Y[:, k] - output(T[k], path[:, k], U[:, k])
        e = casadi.if_else(casadi.DM(model.angles) > 0, casadi.atan2(casadi.sin(e), casadi.cos(e)), e)
        cost += casadi.sumsqr(seen[:, k] * e / np.sqrt(prior.R))
        if k < steps:
            length = T[k + 1] - T[k]
            after = move(T[k], path[:, k], U[:, k], U[:, k + 1], length)
            kick = casadi.MX.zeros(n)
            kick[noisy.tolist()] = np.sqrt(prior.Q[noisy]) * casadi.sqrt(length) * w[:, k]
            gaps.append(path[:, k + 1] - after - kick)
    problem = {
        "x": casadi.veccat(a, w, X), "f": 0.5 * cost, "g": casadi.vertcat(*gaps),
        "p": casadi.veccat(mean, S, T, U, Y, seen),
    }  # fmt: skip
    quiet = {"print_level": 0, "sb": "yes", "tol": TOLERANCE, "max_iter": ROUNDS}
    # No sensitivity by the data is needed, nor is there one by dt where dt = 0.
    options = {"ipopt": quiet, "print_time": False, "error_on_fail": False, "expand": True, "calc_lam_p": False}
    # A window that fails ends in the status; its evaluations are no news for the terminal.
    options["show_eval_warnings"] = False
    solver = casadi.nlpsol("window", "ipopt", problem, options)
    return Window(solver, steps, n, noisy)


def _functions(model: Model, casadi: Any) -> tuple[Any, Any]:
    """The model's rate(t, x, u) and output(t, x, u) as CasADi functions, parameters at their values."""
    x, u = casadi.SX.sym("x", len(model.states)), casadi.SX.sym("u", len(model.inputs))
    t = casadi.SX.sym("t")
    names: dict[sympy.Symbol, Any] = {symbol(TIME): t}
    names |= {symbol(name): x[i] for i, name in enumerate(model.states)}
    names |= {symbol(name): u[i] for i, name in enumerate(model.inputs)}
    names |= {symbol(name): parameter.value for name, parameter in model.parameters.items()}

    def vector(name: str, expressions: tuple[sympy.Expr, ...]) -> Callable[..., Any]:
        values = casadi.vertcat(*(translated(e, names, casadi) for e in expressions))
        function: Callable[..., Any] = casadi.Function(name, [t, x, u], [values])
        return function

    return vector("rate", model.rates), vector("output", model.output_expressions)


def substeps_of(model: Model, record: Record, X: Array) -> int:
    """How many equal RK4 steps a sample needs along a path X (N, n), by the rule of the kernels (`advance`)."""
    fastest = max(
        speed(model.jacobian(float(record.t[k]), X[k], tuple(record.u[k]))) * float(record.dt[k])
        for k in range(len(record) - 1)
    )
    return int(np.clip(math.ceil(fastest / REACH - 1e-9), 1, MOST_SUBSTEPS)) if math.isfinite(fastest) else 1


def solve_window(
    made: Window, record: Record, mean: Array, P: Array, path: Array, noise: Array
) -> tuple[Array, Array, bool]:
    """The best path (samples, n), noise (samples - 1, q) of a record no longer than the window, and whether it is one.

    mean (n,), P (n, n): the arrival cost at its first sample; path, noise: the start of the search.
    """
    M, N, n, q = made.steps, len(record), made.n, len(made.noisy)
    late = M + 1 - N
    t, u = np.pad(record.t, (0, late), mode="edge"), np.pad(record.u, ((0, late), (0, 0)), mode="edge")
    seen = np.pad((~np.isnan(record.y)).astype(np.float64), ((0, late), (0, 0)))
    y = np.pad(np.nan_to_num(record.y), ((0, late), (0, 0)))
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    S = vectors * np.sqrt(np.maximum(values, 0.0))
    given = np.concatenate([mean, S.ravel(order="F"), t, u.ravel(), y.ravel(), seen.ravel()])
    start = np.pad(path, ((0, late), (0, 0)), mode="edge")[1:]
    a = np.linalg.lstsq(S, path[0] - mean, rcond=1e-12)[0]
    guess = np.concatenate([a, np.pad(noise, ((0, M - len(noise)), (0, 0))).ravel(), start.ravel()])
    found = made.solver(x0=guess, p=given, lbg=0.0, ubg=0.0)
    z = np.asarray(found["x"]).ravel()
    w, X = z[n : n + q * M].reshape(M, q), z[n + q * M :].reshape(M, n)
    path = np.vstack([mean + S @ z[:n], X])[:N]
    return path, w[: N - 1], bool(made.solver.stats()["success"]) and bool(np.all(np.isfinite(z)))
