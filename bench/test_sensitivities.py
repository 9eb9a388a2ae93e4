"""The prediction-error pass with sensitivities against what CasADi and JAX make of the same equations.

All simulate 801 samples by one RK4 step each and give the errors and their slopes by two first states and three
parameters, forward, in float64, on one thread. CasADi: `mapaccum` of the step with its tangent, by the Jacobian of the
step itself, on its virtual machine. JAX: `jit` of `jacfwd` of a `lax.scan`. Compile times are outside.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from suite.discovery.fit import prepare

DT = 0.05
DUE = 1e-6  # of a slope: what peers may differ by


@pytest.fixture(scope="module")
def pass_(plants: SimpleNamespace) -> SimpleNamespace:
    """Ours, prepared: the record, its noise, the point of linearisation, and what a pass gives there."""
    plant = plants.paper(estimated=True)
    problem = prepare(plant.model, plant.record)
    assert problem.substeps == 1
    start, N = problem.start, len(plant.record)
    found = problem.run(start, 0.0)
    return SimpleNamespace(
        run=lambda: problem.run(start, 0.0), t=plant.record.t, y=plant.record.y, sigma=np.sqrt(problem.R),
        theta=np.concatenate([start.x0[0], start.p]), e=found.e.reshape(N, 2), J=found.J.reshape(N, 2, 5), steps=N,
    )  # fmt: skip


def _rate(cos: Callable[[Any], Any], t: Any, x: Any, a: Any) -> list[Any]:
    return [2.5 * cos(t) - a[0] * x[0] - a[1] * x[1] - a[2] * x[1] ** 3, x[0]]


def test_against_casadi(ratio: Any, pass_: SimpleNamespace) -> None:
    """Errors and slopes agree, and ours is ahead."""
    casadi = pytest.importorskip("casadi", reason="CasADi is not installed; it is in the dependency group bench")
    x, a, t = casadi.SX.sym("x", 2), casadi.SX.sym("a", 3), casadi.SX.sym("t")

    def f(t: Any, x: Any) -> Any:
        return casadi.vertcat(*_rate(casadi.cos, t, x, a))

    k1 = f(t, x)
    k2 = f(t + DT / 2, x + DT / 2 * k1)
    k3 = f(t + DT / 2, x + DT / 2 * k2)
    k4 = f(t + DT, x + DT * k3)
    after = x + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    S = casadi.SX.sym("S", 2, 5)
    moved = casadi.jacobian(after, x) @ S + casadi.horzcat(casadi.SX(2, 2), casadi.jacobian(after, a))
    state, grown = casadi.vertcat(x, casadi.vec(S)), casadi.vertcat(after, casadi.vec(moved))
    step = casadi.Function("step", [state, t, a], [grown])
    run = step.mapaccum("run", pass_.steps - 1)
    times, parameters = casadi.DM(pass_.t[:-1]).T, casadi.DM(np.tile(pass_.theta[2:, None], pass_.steps - 1))
    first = casadi.DM(np.concatenate([pass_.theta[:2], np.eye(2, 5).ravel(order="F")]))

    def theirs() -> tuple[Any, Any]:
        path = run(first, times, parameters).full().T
        path = np.vstack([first.full().T, path])
        J = path[:, 2:].reshape(-1, 5, 2).transpose(0, 2, 1)
        return (pass_.y - path[:, :2]) / pass_.sigma, -J / pass_.sigma[:, None]

    _agree(pass_, *theirs())
    ratio(
        "prediction-error pass with 5 sensitivities, n = 2", pass_.run, "CasADi", theirs, unit="step", per=pass_.steps,
        rounds=200, turns=50,
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore")  # of the library itself, while it is imported
def test_against_jax(ratio: Any, pass_: SimpleNamespace) -> None:
    """Errors and slopes agree, and ours is ahead."""
    jax = pytest.importorskip("jax", reason="JAX is not installed; it is in the dependency group bench")
    jax.config.update("jax_enable_x64", True)
    jnp = jax.numpy
    times, y, sigma = (jnp.asarray(values) for values in (pass_.t[:-1], pass_.y, pass_.sigma))

    def errors(theta: Any) -> Any:
        def f(t: Any, x: Any) -> Any:
            return jnp.stack(_rate(jnp.cos, t, x, theta[2:]))

        def step(x: Any, t: Any) -> tuple[Any, Any]:
            k1 = f(t, x)
            k2 = f(t + DT / 2, x + DT / 2 * k1)
            k3 = f(t + DT / 2, x + DT / 2 * k2)
            k4 = f(t + DT, x + DT * k3)
            after = x + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            return after, after

        _, path = jax.lax.scan(step, theta[:2], times)
        e = (y - jnp.vstack([theta[None, :2], path])) / sigma
        return e, e

    both = jax.jit(jax.jacfwd(errors, has_aux=True))
    theta = jnp.asarray(pass_.theta)

    def theirs() -> tuple[Any, Any]:
        J, e = jax.block_until_ready(both(theta))
        return np.asarray(e), np.asarray(J)

    _agree(pass_, *theirs())
    ratio(
        "prediction-error pass with 5 sensitivities, n = 2", pass_.run, "JAX", theirs, unit="step", per=pass_.steps,
        rounds=200, turns=50,
    )  # fmt: skip


def _agree(ours: SimpleNamespace, e: Any, J: Any) -> None:
    np.testing.assert_allclose(ours.e, e, rtol=0.0, atol=DUE * np.abs(e).max())
    np.testing.assert_allclose(ours.J, J, rtol=0.0, atol=DUE * np.abs(J).max())
