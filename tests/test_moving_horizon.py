"""Moving-horizon estimation is the Kalman filter where that is exact, and least squares where it is not."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from estimators.moving_horizon import MovingHorizon
from suite.disturbance import with_random_walk
from suite.filtering import filtered
from suite.model import Input, Model, Output, Parameter


@pytest.mark.parametrize("horizon", [100, 4])
def test_moving_horizon_is_the_kalman_filter_on_a_linear_plant(horizon: int, plants: Any) -> None:
    """Whatever the horizon, as its arrival cost is then exact: states, d and covariances to 1e-6."""
    pytest.importorskip("casadi")
    record = plants.record(plants.OSCILLATOR, 25)
    grown, start = with_random_walk(plants.OSCILLATOR, record, plants.PRIOR, 1.0)
    run = filtered(grown, record, start.x0, start.P0, start.Q, start.R)
    found = MovingHorizon().estimate(plants.OSCILLATOR, record, horizon=horizon)
    assert found.status == "ok", found.note
    assert found.d is not None
    assert found.P is not None
    np.testing.assert_allclose(found.x, run.x[:, :2], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.d[:, 1], run.x[:, 2], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.P, run.P[:, :2, :2], rtol=0.0, atol=1e-8)


def test_moving_horizon_finds_the_most_probable_path(plants: Any) -> None:
    """On the pendulum its end is that of scipy's least squares over the first state and all noise, to 1e-4."""
    pytest.importorskip("casadi")
    record = plants.record(plants.PENDULUM, 9, dt=0.3)
    grown, start = with_random_walk(plants.PENDULUM, record, plants.PRIOR, 1.0)
    N = len(record)

    def path(z: np.ndarray) -> np.ndarray:
        xs = [start.x0 + np.sqrt(np.diag(start.P0)) * z[:3]]
        for k in range(N - 1):
            x = grown.step(record.t[k], xs[-1], record.u[k], record.dt[k], record.u[k + 1])
            xs.append(x + np.array([0.0, 0.0, np.sqrt(start.Q[2] * record.dt[k]) * z[3 + k]]))
        return np.array(xs)

    def residuals(z: np.ndarray) -> np.ndarray:
        e = record.y - path(z)[:, :2]
        e[:, 0] = np.arctan2(np.sin(e[:, 0]), np.cos(e[:, 0]))
        return np.concatenate([z, np.nan_to_num(e / np.sqrt(plants.PRIOR.R)).ravel()])

    best = path(least_squares(residuals, np.zeros(N + 2), xtol=1e-12, ftol=1e-12, gtol=1e-12).x)
    found = MovingHorizon().estimate(plants.PENDULUM, record, horizon=N)
    assert found.d is not None
    # CasADi's steps are of one length, the model's adapt: both err by less than 1e-5 of the state.
    np.testing.assert_allclose(found.x[-1], best[-1, :2], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(found.d[-1, 1], best[-1, 2], rtol=0.0, atol=1e-4)


def test_every_function_of_the_language_is_translated() -> None:
    """CasADi's value of each function, power and constant is the compiled model's at random points, to 1e-12."""
    casadi = pytest.importorskip("casadi")
    from estimators._moving_horizon import _functions

    equations = [
        "sin(x) + cos(y)*tan(x/4)", "asin(x/9) + acos(y/9) + atan(x) + atan2(x, y)", "sinh(x) - cosh(y) + tanh(x*y)",
        "exp(-x) + log(9 + y) + sqrt(9 + x)", "abs(x) + sign(y) + min(x, y) + max(x, min(y, 0.5))",
        "pi*x**3/y + (9 + x)**0.3 + (9 + y)**x + k*t + F",
    ]  # fmt: skip
    names = [chr(ord("a") + i) for i in range(len(equations) - 2)]
    model = Model(
        name="all", states={"x": equations[0], "y": equations[1], **dict(zip(names, equations[2:], strict=True))},
        parameters={"k": Parameter(0.7)}, inputs={"F": Input("F")}, outputs={"z": Output("a*b", "z")},
    )  # fmt: skip
    rate, output = _functions(model, casadi)
    for x in np.random.default_rng(0).uniform(-3.0, 3.0, (20, 6)):
        np.testing.assert_allclose(np.asarray(rate(0.4, x, [1.1])).ravel(), model.rate(0.4, x, (1.1,)), rtol=1e-12)
        np.testing.assert_allclose(np.asarray(output(0.4, x, [1.1])).ravel(), model.output(0.4, x, (1.1,)), rtol=1e-12)


def test_without_casadi_the_plug_in_loads_and_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, plants: Any) -> None:
    """`skip` names the extra and the plain package; nothing is imported."""
    monkeypatch.setitem(sys.modules, "casadi", None)
    said = str(MovingHorizon().skip(plants.OSCILLATOR, plants.record(plants.OSCILLATOR)))
    assert "unmodelled[mhe]" in said
    assert "pip install casadi" in said
