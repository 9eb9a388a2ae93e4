"""A maximum-likelihood refit against scipy's and pysindy's way to the same parameters.

The plant of the paper, 801 samples of both states with 5 % noise; three parameters and two first states are unknown and
start 20 % off. scipy: `least_squares` over `solve_ivp` (RK45, rtol 1e-6), its own difference quotients, from the same
start and with the noise given. pysindy: the library of cubic polynomials and the known force, its own derivatives and
thresholds, then its simulation of the result, which ours and scipy's give as well.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from suite.discovery.fit import fit, levenberg_marquardt, prepare
from suite.discovery.frame import Point

LOOSE = {"method": "RK45", "rtol": 1e-6, "atol": 1e-8}  # of both simulations, beside RK4 at 0.05 s


@pytest.fixture(scope="module")
def started(plants: SimpleNamespace) -> SimpleNamespace:
    """The plant with its parameters 20 % off, and nothing known of them."""
    plant = plants.paper(estimated=True)
    off = {name: replace(p, value=1.2 * p.value, free=True) for name, p in plant.model.parameters.items()}
    return SimpleNamespace(model=replace(plant.model, parameters=off), record=plant.record)


@pytest.mark.parametrize("whole", [False, True], ids=["like with like", "whole fit"])
def test_against_scipy(ratio: Any, started: SimpleNamespace, whole: bool) -> None:
    """To the same parameters within a tenth of their deviations: least squares of a simulation, from the same start and
    with the noise given, at least 100 times as fast; and all that `fit` does beside, ahead.
    """
    model, record = started.model, started.record
    found = fit(model, record)
    sigma = found.sigma

    def rate(t: float, x: Any, a1: float, a2: float, a3: float) -> list[float]:
        return [2.5 * np.cos(t) - a1 * x[0] - a2 * x[1] - a3 * x[1] ** 3, x[0]]

    def residuals(theta: Any) -> Any:
        run = solve_ivp(rate, (record.t[0], record.t[-1]), theta[:2], t_eval=record.t, args=tuple(theta[2:]), **LOOSE)
        return ((record.y - run.y.T) / sigma).ravel()

    start = np.concatenate([record.y[0], model.values])
    theta = least_squares(residuals, start).x
    for (value, sd), other in zip(found.parameters.values(), theta[2:], strict=True):
        assert abs(value - other) < 0.1 * sd
    problem = prepare(model, record)
    there = Point(record.y[:1].copy(), problem.start.p)

    def ours() -> Any:
        return fit(model, record) if whole else levenberg_marquardt(problem, there, 0.0, (), 60, 1e-5)

    point = levenberg_marquardt(problem, there, 0.0, (), 60, 1e-5).point
    np.testing.assert_allclose(point.p, theta[2:], rtol=0.0, atol=1e-3)
    what = "with noise, homotopy and deviations" if whole else "simulation alone, from the same start"
    ratio(
        f"refit of 3 parameters and 2 first states, {what}", ours, "scipy: solve_ivp and least_squares",
        lambda: least_squares(residuals, start), at_least=None if whole else 100.0, unit="refit", slow=True,
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore")  # of the library itself
def test_against_pysindy(ratio: Any, started: SimpleNamespace) -> None:
    """Ahead of its fit and simulation."""
    pysindy = pytest.importorskip("pysindy", reason="pysindy is not installed; it is in the dependency group bench")
    model, record = started.model, started.record
    force = 2.5 * np.cos(record.t)[:, None]

    def theirs() -> tuple[Any, Any]:
        learned = pysindy.SINDy(
            feature_library=pysindy.PolynomialLibrary(degree=3, include_bias=False),
            optimizer=pysindy.STLSQ(threshold=0.01),
            differentiation_method=pysindy.SmoothedFiniteDifference(),
        )  # fmt: skip
        learned.fit(record.y, t=record.t, u=force)
        return learned, learned.simulate(record.y[0], record.t, u=force, integrator="solve_ivp", integrator_kws=LOOSE)

    ratio(
        "refit of 3 parameters and 2 first states, with noise, homotopy and deviations", lambda: fit(model, record),
        "pysindy: fit and simulate", theirs, unit="refit", rounds=20, slow=True,
    )  # fmt: skip
