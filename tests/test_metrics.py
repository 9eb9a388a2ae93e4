"""The numbers that a run is judged by are those of the textbook formulas, in any units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suite import plugins
from suite.benchmark import innovations, metrics
from suite.case import Case, Experiment, Missing
from suite.contracts import plants
from suite.model import Initial, Model, Output
from suite.prior import default_prior


def test_nis_and_nees_are_one_for_an_exact_filter() -> None:
    """On a linear plant without model error the Kalman filter's NIS and NEES, as the judge computes them, are 1."""
    model = Model("still", {"x": "0*x"}, outputs={"x": Output("x", "x")}, initial={"x": Initial(0.0, estimate=True)})
    case = Case("still", "", model, truth=model, experiment=Experiment(60.0, 0.05, (1.0,)))
    record, truth = case.simulate(0.0, 0)
    rng = np.random.default_rng(3)
    x = 1.0 + np.cumsum(0.1 * np.sqrt(0.05) * rng.standard_normal(len(record)))[:, None]
    y = x + 0.05 * rng.standard_normal(x.shape)
    record = replace(record, y=y)
    prior = replace(default_prior(model, record, np.array([0.05])), Q=np.array([0.01]))
    estimate = plugins.estimators()["ekf"].estimate(model, record.with_prior(prior))
    row = metrics.judge(case, record.with_prior(prior), replace(truth, x=x), estimate, "filter")
    assert row["nis"] == pytest.approx(1.0, abs=0.15)
    assert row["nees"] == pytest.approx(1.0, abs=0.25)


def test_the_judge_at_once_is_the_judge_sample_by_sample() -> None:
    """Residuals, innovations, NIS, NEES and coefficients of whole arrays are those of the textbook formulas, taken
    one sample after another, on a record whose channels have gaps of their own.
    """
    case = Case(
        "hardening", "", plants.LINEAR, plants.HARDENING, missing=(Missing("cubic_stiffness", "v", {"a": 1.0}),)
    )
    model = case.deficient
    record = plants.by_channel(plants.record(model, plants.HARDENING), model)
    estimate = plugins.estimators()["random-walk-filter"].estimate(model, record)
    P, d = estimate.P, estimate.d
    assert P is not None
    assert d is not None
    assert record.prior is not None
    # A direction that is known exactly, and one sample whose filter follows its sensor to the last digit.
    P = P.copy()
    P[5] = np.diag([0.0, 0.3])
    P[8] = np.diag(record.prior.R)
    estimate = replace(estimate, P=P)
    r = np.array([record.y[k] - model.output(record.t[k], estimate.x[k], record.u[k]) for k in range(len(record))])
    R, e = record.prior.R, np.full(r.shape, np.nan)
    for k in range(1, len(record)):
        seen = ~np.isnan(record.y[k])
        H = model.output_jacobian(record.t[k], estimate.x[k], record.u[k])[seen]
        gap = np.diag(R[seen]) - H @ P[k] @ H.T
        if seen.any() and np.linalg.eigvalsh(gap / R[seen].max())[0] > 1e-9:
            e[k, seen] = np.linalg.solve(np.linalg.cholesky(gap), r[k, seen])
    whole = innovations.whitened(model, record, estimate)
    assert whole is not None
    assert np.isnan(e).any(axis=1).sum() > len(record) / 2
    assert not np.isfinite(e[8]).any()
    np.testing.assert_allclose(whole, e, rtol=1e-10)
    rows = np.isfinite(e).any(axis=1)
    assert metrics.nis(model, record, estimate) == pytest.approx(np.nanmean(e[rows] ** 2, axis=1).mean(), rel=1e-10)
    error = estimate.x - np.roll(estimate.x, 1, axis=0)
    squares = [error[k] @ np.linalg.pinv(P[k], hermitian=True) @ error[k] for k in range(len(record))]
    assert metrics.nees(error, P) == pytest.approx(np.mean(squares) / 2, rel=1e-10)
    row = metrics.judge(case, record, None, estimate, "filter")
    rms = np.sqrt(np.nanmean(r**2, axis=0))
    assert list(row["output_rmse"].values()) == pytest.approx(rms.tolist(), rel=1e-10)
    cubes = -(estimate.x[:, 0] ** 3)
    found = metrics.coefficients(case, record, estimate)["parameters"]["a"]
    assert found == pytest.approx(cubes @ d[:, 1] / (cubes @ cubes), rel=1e-10)


def test_the_first_sample_is_no_innovation() -> None:
    """The first state may come from it, so that its residual says nothing; every later one does where it is whole."""
    model = plants.LINEAR
    record = plants.record(model, plants.HARDENING)
    estimate = plugins.estimators()["random-walk-filter"].estimate(model, record)
    assert not np.isnan(record.y[0]).any()
    found = innovations.whitened(model, record, estimate)
    assert found is not None
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()


def test_nees_does_not_depend_on_units_and_is_no_difference_of_large_numbers() -> None:
    """States in millimetres and megagrams, a covariance that is singular but for its rounding: the same, not < 0."""
    rng = np.random.default_rng(3)
    a = rng.standard_normal((50, 3, 2))
    P = a @ a.transpose(0, 2, 1)  # two directions are known to nothing, the third exactly
    error = np.einsum("kij,kj->ki", a, rng.standard_normal((50, 2)))
    found = metrics.nees(error, P)
    assert found == pytest.approx(2.0 / 3.0, rel=0.2)
    units = np.array([1e3, 1e-6, 1.0])
    assert metrics.nees(error * units, P * units[:, None] * units) == pytest.approx(found, rel=1e-6)
    rough = P * (1.0 + 1e-13 * rng.standard_normal(P.shape))
    assert metrics.nees(error, 0.5 * (rough + rough.transpose(0, 2, 1))) == pytest.approx(found, rel=1e-6)
