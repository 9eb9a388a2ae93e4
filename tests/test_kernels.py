"""The compiled core agrees with slower arithmetic, in any units, with any cache."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from suite.kernels.integrate import advance, workspace
from suite.kernels.prediction import prediction_errors
from suite.kernels.step import step
from suite.model import Initial, Input, Model, Output, Parameter

Array = npt.NDArray[np.float64]

DUFFING = Model(
    name="duffing",
    states={"p": "v", "v": "(F*cos(2*t) - c*v - k*p - b*p**3)/m"},
    parameters={"m": Parameter(1.3), "c": Parameter(0.5), "k": Parameter(8.0), "b": Parameter(3.0)},
    inputs={"F": Input("F", "linear")},
    outputs={"pos": Output("p", "pos"), "work": Output("p*v + k*p", "work")},
)


def _move(model: Model, x0: Array, p: Array, dt: float, u: tuple[float, float], substeps: int) -> tuple[Array, Array]:
    """The state after dt, and [dx/dx0 | dx/dp], from the kernel."""
    n, count = len(model.states), len(p)
    x, T = x0.copy(), np.zeros((n, n + count))
    advance(
        model.program.rate, 0.3, dt, np.array([u[0]]), np.array([u[1]]), model.linear_inputs, p,
        model.program.all_off(), np.arange(count), substeps, x, T, workspace(n, 1, count, count),
    )  # fmt: skip
    return x, T


def test_a_sample_agrees_with_a_solver_of_high_order() -> None:
    """RK4 within a sample, with a forced nonlinear plant and an input on a line, has small error."""
    x0, p, dt = np.array([0.6, -0.4]), DUFFING.values, 0.05
    reference = solve_ivp(
        lambda t, x: DUFFING.rate(t, x, [1.0 + (2.5 - 1.0) * (t - 0.3) / dt]),
        (0.3, 0.3 + dt),
        x0,
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    errors = [np.max(np.abs(_move(DUFFING, x0, p, dt, (1.0, 2.5), parts)[0] - reference)) for parts in (1, 2, 4)]
    assert errors[0] < 1e-6
    # Fourth order: halving the part divides the error by about 16.
    assert errors[0] / errors[1] > 10
    assert errors[1] / errors[2] > 10


def test_the_tangent_is_the_difference_quotient_of_the_step() -> None:
    """T differentiates the numerical step itself, by the state and by every parameter."""
    x0, p, step = np.array([0.6, -0.4]), DUFFING.values, 1e-6
    _, T = _move(DUFFING, x0, p, 0.2, (1.0, 2.5), 3)
    for j in range(2):
        e = np.eye(2)[j] * step
        ends = [_move(DUFFING, x0 + s * e, p, 0.2, (1.0, 2.5), 3)[0] for s in (1, -1)]
        np.testing.assert_allclose(T[:, j], (ends[0] - ends[1]) / (2 * step), rtol=1e-7, atol=1e-8)
    for j in range(4):
        e = np.eye(4)[j] * step
        ends = [_move(DUFFING, x0, p + s * e, 0.2, (1.0, 2.5), 3)[0] for s in (1, -1)]
        np.testing.assert_allclose(T[:, 2 + j], (ends[0] - ends[1]) / (2 * step), rtol=1e-7, atol=1e-8)


def test_the_address_that_is_given_is_what_moves_the_state() -> None:
    """`step` calls the step of the address where there is one, and the rates it is given where there is none."""
    grows = Model("grows", {"x": "k*x"}, {"k": Parameter(1.0)}, initial={"x": Initial(1.0)})
    decays = replace(grows, name="decays", states={"x": "-k*x"})
    off, none = grows.program.all_off(), np.zeros(0, dtype=np.int64)
    ends = []
    for own in (decays.program.step_when(off), 0):
        x, T = np.ones(1), np.zeros((1, 1))
        step(
            own, grows.program.rate, 0.0, 0.1, none.astype(float), none.astype(float), grows.linear_inputs,
            grows.values, off, none, 1, x, T, workspace(1, 0, 1, 0),
        )  # fmt: skip
        assert T[0, 0] == pytest.approx(x[0])
        ends.append(x[0])
    assert ends == pytest.approx([np.exp(-0.1), np.exp(0.1)], rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.floats(-9.0, 9.0), st.floats(0.01, 3.0))
def test_the_step_does_not_depend_on_the_units_of_a_state(decades: float, dt: float) -> None:
    """The substep rule is unchanged when a state is measured in units of 1e-9 to 1e9."""
    scale = 10.0**decades
    model = Model(
        "two states, one in units of 1/g",
        {"p": "w/g", "w": "g*(u - c*w/g - k*p)"},
        {"g": Parameter(1.0), "c": Parameter(0.5), "k": Parameter(400.0)},
        inputs={"u": Input("u")},
    )
    ends = []
    for g in (1.0, scale):
        x, _ = _move(model, np.array([0.6, -0.4 * g]), np.array([g, 0.5, 400.0]), dt, (1.0, 1.0), 1)
        ends.append(x / [1.0, g])
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-9)


def test_a_stiff_plant_is_cut_finely_enough() -> None:
    """A sample much longer than the time constant stays stable and accurate."""
    model = Model("fast", {"x": "-k*x + u"}, {"k": Parameter(200.0)}, inputs={"u": Input("u")})
    x, _ = _move(model, np.array([1.0]), np.array([200.0]), 0.1, (2.0, 2.0), 1)
    assert x[0] == pytest.approx(0.01 + 0.99 * np.exp(-20.0), rel=1e-4)


class _Pass:
    """One pass of the prediction-error filter over arrays; attributes are what the kernel wrote."""

    def __init__(
        self, model: Model, t: Array, u: Array, y: Array, x0: Array, p: Array, *,
        starts: tuple[int, ...] = (0,), Q: Array | None = None, angle: Array | None = None,
    ) -> None:  # fmt: skip
        n, ny, count, N = len(model.states), len(model.outputs), len(p), len(t)
        self.e, self.s, self.J = np.zeros((N, ny)), np.zeros((N, ny)), np.zeros((N, ny, n + count))
        self.X, self.Y = np.zeros((N, n)), np.zeros((N, ny))
        scratch = (
            np.zeros(n), np.zeros(ny), np.zeros((ny, n)), np.zeros((ny, count)), np.zeros((n, n)), np.zeros((n, n)),
            np.zeros((n, n + count)), np.zeros((n, n + count)), np.zeros((n, n + count)), np.zeros(n),
        )  # fmt: skip
        program = model.program
        self.status = prediction_errors(
            program.step_when(program.all_off()), program.rate, program.output, t, u, model.linear_inputs, y,
            np.array([*starts, N]), x0, p, program.all_off(), np.arange(count), np.zeros(n) if Q is None else Q,
            np.full(ny, 0.04),
            np.zeros(ny) if angle is None else angle, 1, workspace(n, len(model.inputs), count, count), scratch,
            self.e, self.s, self.J, self.X, self.Y,
        )  # fmt: skip


def _experiment(N: int = 60) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.02, 0.15, N))
    return t, rng.normal(size=(N, 1)), rng.normal(size=(N, 2))


def test_without_process_noise_the_errors_are_those_of_a_simulation() -> None:
    """With Q = 0, e = (y - simulated)/sigma, with irregular steps and an input on lines."""
    t, u, y = _experiment()
    x = np.array([0.5, 0.1])
    run = _Pass(DUFFING, t, u, y, x[None, :], DUFFING.values)
    assert run.status == -1
    for k in range(len(t)):
        if k:
            x = DUFFING.step(t[k - 1], x, u[k - 1], t[k] - t[k - 1], u[k])
        np.testing.assert_allclose(run.e[k], (y[k] - DUFFING.output(t[k], x, u[k])) / 0.2, rtol=1e-9, atol=1e-9)


def test_sensitivities_are_difference_quotients_of_the_errors() -> None:
    """With Q = 0, J is the exact derivative by the first state and the parameters."""
    t, u, y = _experiment()
    x0, p, step = np.array([[0.5, 0.1]]), DUFFING.values, 1e-6
    J = _Pass(DUFFING, t, u, y, x0, p).J
    for j in range(6):
        e = np.eye(6)[j] * step
        ends = [_Pass(DUFFING, t, u, y, x0 + s * e[:2], p + s * e[2:]).e for s in (1, -1)]
        np.testing.assert_allclose(J[:, :, j], (ends[0] - ends[1]) / (2 * step), rtol=1e-5, atol=1e-5)


def test_missing_samples_count_nothing() -> None:
    """NaN gives e = 0, s = 1, J = 0, and changes nothing elsewhere."""
    t, u, y = _experiment()
    holes = y.copy()
    holes[5:9, 0] = np.nan
    holes[20] = np.nan
    whole, part = (_Pass(DUFFING, t, u, data, np.array([[0.5, 0.1]]), DUFFING.values) for data in (y, holes))
    gone = np.isnan(holes)
    assert np.all(part.e[gone] == 0.0)
    assert np.all(part.s[gone] == 1.0)
    assert np.all(part.J[gone] == 0.0)
    np.testing.assert_array_equal(part.e[~gone], whole.e[~gone])
    np.testing.assert_array_equal(part.J[~gone], whole.J[~gone])


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_runs_together_are_runs_apart(noise: float) -> None:
    """Every run starts from its own state, and forgets the others."""
    t, u, y = _experiment()
    x0, Q = np.array([[0.5, 0.1], [-0.3, 0.2]]), np.array([0.0, noise])
    time = np.concatenate([t[:25], t[25:] - 7.0])
    both = _Pass(DUFFING, time, u, y, x0, DUFFING.values, starts=(0, 25), Q=Q)
    for run, part in enumerate((slice(0, 25), slice(25, 60))):
        alone = _Pass(DUFFING, time[part], u[part], y[part], x0[run : run + 1], DUFFING.values, Q=Q)
        for name in ("e", "s", "J", "X", "Y"):
            np.testing.assert_array_equal(getattr(both, name)[part], getattr(alone, name))


def test_with_process_noise_the_filter_is_the_kalman_filter() -> None:
    """On a linear plant e, s and the state are those of the textbook, with matrices and an inverse."""
    model = Model("linear", {"p": "v", "v": "-4*p - 0.3*v"}, outputs={"a": Output("p", "a"), "b": Output("p + v", "b")})
    t, _, y = _experiment()
    Q = np.array([0.0, 0.3])
    run = _Pass(model, t, np.zeros((len(t), 0)), y, np.array([[0.5, 0.1]]), np.zeros(0), Q=Q)
    x, P, H, R = np.array([0.5, 0.1]), np.zeros((2, 2)), np.array([[1.0, 0.0], [1.0, 1.0]]), 0.04 * np.eye(2)
    for k in range(len(t)):
        if k:
            dt = t[k] - t[k - 1]
            x, F = model.transition(t[k - 1], x, [], dt)
            P = F @ P @ F.T + np.diag(Q) * dt
        S = H @ P @ H.T + R
        nu = y[k] - H @ x
        # Channels one at a time are the Cholesky whitening of the joint innovation.
        np.testing.assert_allclose(run.e[k], np.linalg.solve(np.linalg.cholesky(S), nu), rtol=1e-8, atol=1e-10)
        assert np.prod(run.s[k]) == pytest.approx(np.linalg.det(S))
        K = P @ H.T @ np.linalg.inv(S)
        x, P = x + K @ nu, P - K @ H @ P
        np.testing.assert_allclose(run.X[k], x, rtol=1e-8, atol=1e-10)


def test_angles_wrap() -> None:
    """A pendulum that turned once more is not an error of 2 pi."""
    model = Model("turn", {"a": "0"}, outputs={"a": Output("a", "a", angle=True)})
    y = np.array([[0.1], [0.1 + 2 * np.pi], [0.1 - 6 * np.pi]])
    run = _Pass(model, np.arange(3.0), np.zeros((3, 0)), y, np.zeros((1, 1)), np.zeros(0), angle=np.ones(1))
    np.testing.assert_allclose(run.e, 0.5, rtol=1e-12)


def test_a_simulation_that_escapes_says_where() -> None:
    """The sample of the first infinite number comes back; nothing is raised."""
    model = Model("escape", {"x": "x**3"}, outputs={"x": Output("x", "x")})
    t = np.arange(40.0)
    run = _Pass(model, t, np.zeros((40, 0)), np.zeros((40, 1)), np.ones((1, 1)), np.zeros(0))
    assert 0 < run.status < 40
    assert np.all(np.isfinite(run.X[: run.status]))


PROGRAM = """
import warnings
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    import numpy as np
    from suite.model import Model, Output
    model = Model("m", {"x": "-x**3 + sign(x)"}, outputs={"y": Output("2*x", "y")})
    print(model.step(0.0, np.ones(1), [], 0.5)[0], model.output(0.0, np.ones(1))[0])
print([str(w.message) for w in caught if w.category is RuntimeWarning])
"""


def _start(cache: str, code: str = PROGRAM) -> subprocess.Popen[str]:
    environment = {**os.environ, "UNMODELLED_CACHE": cache}
    return subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_two_processes_may_fill_an_empty_cache_at_once(tmp_path: Path) -> None:
    """Both get the right numbers, and the next start finds a usable cache."""
    outputs = [process.communicate() for process in [_start(str(tmp_path)), _start(str(tmp_path))]]
    outputs.append(_start(str(tmp_path)).communicate())
    for out, err in outputs:
        assert out == "1.0 2.0\n[]\n", err
    assert list(tmp_path.glob("model_*.o"))
    assert not list(tmp_path.glob("*.tmp"))


def test_without_a_writable_cache_there_is_one_warning_and_the_same_numbers(tmp_path: Path) -> None:
    """A folder that cannot be made costs time, not results."""
    (tmp_path / "file").write_text("")
    out, err = _start(str(tmp_path / "file" / "cache")).communicate()
    numbers, warned = out.strip().split("\n")
    assert numbers == "1.0 2.0", err
    assert warned.count("cannot be kept") == 1
    assert "UNMODELLED_CACHE" in warned
