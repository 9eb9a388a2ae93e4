"""The predictive filter is its equations, finds the model error, and meets its covariance constraint."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from estimators._predictive import prediction
from estimators.predictive_filter import PredictiveFilter
from suite.case import Case, Experiment
from suite.model import Model, Output
from suite.record import Prior, Record


def test_the_predictive_filter_is_its_equations(plants: Any) -> None:
    """x and d equal a filter written with Lie derivatives by hand and an ODE solver, to 1e-6."""
    record = plants.record(plants.PENDULUM)
    found = PredictiveFilter().estimate(plants.PENDULUM, record, w_scale=0.3)
    x, xs, ds = plants.PRIOR.x0, [plants.PRIOR.x0], [0.0]
    for k in range(len(record) - 1):
        t, dt, (F0,), (F1,) = record.t[k], record.dt[k], record.u[k], record.u[k + 1]

        def rate(s: float, x: np.ndarray, d: float, t=t, dt=dt, F0=F0, F1=F1) -> list[float]:
            return [x[1], F0 + (s - t) / dt * (F1 - F0) - 0.3 * x[1] - 2.0 * np.sin(x[0]) + d]

        f = rate(t, x, 0.0)
        # The angle feels d in its second derivative, its rate in the first.
        z = np.array([dt * x[1] + dt**2 / 2.0 * f[1], dt * f[1]])
        LS = np.array([dt**2 / 2.0, dt])
        e = record.y[k + 1] - x - z
        e[0] = np.arctan2(np.sin(e[0]), np.cos(e[0]))
        seen = ~np.isnan(e)
        W = 0.3 * dt / plants.PRIOR.Q[1]
        d = float(np.sum((LS * e / plants.PRIOR.R)[seen]) / (np.sum((LS**2 / plants.PRIOR.R)[seen]) + W))
        x = solve_ivp(rate, (t, t + dt), x, args=(d,), rtol=1e-10, atol=1e-12).y[:, -1]
        xs.append(x)
        ds.append(d)
    assert found.d is not None
    np.testing.assert_allclose(found.x, np.array(xs), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.d[:, 1], ds, rtol=0.0, atol=1e-5)


def test_with_exact_measurements_the_predictive_d_is_the_model_error(plants: Any) -> None:
    """Without weight on d its error on a linear plant is that of the expansion: it halves with the step."""
    truth = plants.OSCILLATOR.plus("v", "0.8*cos(2*t)")
    errors = []
    for dt in (0.04, 0.02, 0.01):
        record, _ = Case("exact", "", plants.OSCILLATOR, truth, Experiment(4.0, dt, (1.0, 0.0))).simulate(0.0, 0)
        exact = Prior(np.array([1.0, 0.0]), np.zeros((2, 2)), np.array([1.0, 1e-8]), plants.PRIOR.Q)
        found = PredictiveFilter().estimate(plants.OSCILLATOR, record.with_prior(exact), w_scale=1e-6)
        assert found.d is not None
        errors.append(np.max(np.abs(found.d[1:, 1] - 0.8 * np.cos(2.0 * (record.t[1:] - dt / 2.0)))))
    assert errors[0] < 0.1
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.3)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.3)


def test_relative_degrees_are_found_and_what_no_output_sees_is_refused() -> None:
    """A chain of integrators has degree 3, 2 and 1; an output beside the chain has none and is a reason to skip."""
    chain = Model(
        name="chain", states={"a": "b", "b": "c", "c": "-a", "e": "-e"}, suspect=("c",),
        outputs={"h3": Output("a", "1"), "h2": Output("b**2", "2"), "h1": Output("c", "3"), "no": Output("e", "4")},
    )  # fmt: skip
    np.testing.assert_array_equal(prediction(chain).degree, [3, 2, 1, 0])
    blind = Model(name="blind", states=chain.states, suspect=("c",), outputs={"no": Output("e", "4")})
    record = Record(np.arange(3.0), np.zeros((3, 0)), np.zeros((3, 1)))
    assert "no output responds" in str(PredictiveFilter().skip(blind, record))


def test_the_covariance_constraint_is_met(plants: Any) -> None:
    """With w_scale None the residual variance is R to 3 %, and a smaller weight leaves less of it."""
    record = plants.record(plants.OSCILLATOR, 200)
    found = PredictiveFilter().estimate(plants.OSCILLATOR, record, w_scale=None)
    assert found.report is not None
    assert found.report["covariance ratio"] == pytest.approx(1.0, abs=0.03)
    less = PredictiveFilter().estimate(plants.OSCILLATOR, record, w_scale=0.01 * float(found.report["w_scale"]))
    assert less.report is not None
    assert float(less.report["covariance ratio"]) < 0.9
