"""Numbers stay what they claim to be: covariances positive, whatever the prior; nothing silently not a number."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from suite import plugins
from suite.filtering import Filtered, filtered
from suite.kernels.factored import factor, informed, measured, product
from suite.model import Model, Output
from suite.record import Prior, Record
from suite.smoothing import smoothed

Array = npt.NDArray[np.float64]

ROUNDING = 1e-9  # of the largest eigenvalue of a correlation
# First variance, sensor variance, noise density: up to what a double cannot hold beside the other.
WIDE = [
    (1.0, 1e-4, 1e-3), (1.0, 1e-4, 0.0), (1e6, 1e-6, 1e-3), (9e13, 1.0, 0.0), (1e20, 1.0, 0.0), (1e12, 1e-12, 1e-3),
]  # fmt: skip


def correlation(P: Array) -> Array:
    """Matrices (..., n, n) in units of their own variances; what has none is zero."""
    variances = np.diagonal(P, axis1=-2, axis2=-1)
    assert variances.min() >= 0.0
    sd = np.sqrt(variances)
    scale = sd[..., :, None] * sd[..., None, :]
    return np.divide(P, scale, out=np.zeros_like(P), where=scale > 0.0)


def indefinite(P: Array) -> float:
    """How far below zero the smallest eigenvalue is, of correlations (..., n, n)."""
    assert np.isfinite(P).all()
    assert np.abs(P - np.swapaxes(P, -1, -2)).max() <= 1e-12 * np.abs(P).max()
    return float(-np.linalg.eigvalsh(correlation(P)).min())


def priors(first: float, sensor: float, noise: float) -> Prior:
    return Prior(np.array([0.0, 1.0]), first * np.eye(2), np.full(2, sensor), np.array([0.0, noise]))


def swinging(prior: Prior, samples: int, outputs: int = 2, dt: float = 0.01) -> Record:
    """A swing that the oscillator of the tests does not quite follow, noise of the prior's size on it."""
    rng = np.random.default_rng(7)
    t = dt * np.arange(samples)
    y = np.column_stack([np.sin(t), np.cos(t)]) + np.sqrt(prior.R) * rng.standard_normal((samples, 2))
    y[:, outputs:] = np.nan
    return Record(t, np.zeros((samples, 0)), y, prior=prior)


def passed(model: Model, record: Record) -> Filtered:
    prior = record.prior
    assert prior is not None
    run = filtered(model, record, prior.x0, prior.P0, prior.Q, prior.R)
    assert run.failed_at is None
    return run


@pytest.mark.parametrize("outputs", [1, 2])
@pytest.mark.parametrize("wide", WIDE)
def test_a_covariance_is_one_however_wide_the_prior(
    plants: SimpleNamespace, wide: tuple[float, float, float], outputs: int
) -> None:
    run = passed(plants.OSCILLATOR, swinging(priors(*wide), 400, outputs))
    assert indefinite(run.P) < ROUNDING
    assert indefinite(run.P_prior) < ROUNDING
    assert run.variance.min() >= wide[1]
    both = smoothed(run)
    assert indefinite(both.P) < ROUNDING
    if 1e10 * wide[1] <= wide[0] < 1e15 * wide[1]:
        # A narrower prior says nothing either: both are what the data say.
        other = smoothed(passed(plants.OSCILLATOR, swinging(priors(9e7 * wide[1], *wide[1:]), 400, outputs)))
        spread = np.sqrt(np.diagonal(other.P, axis1=1, axis2=2))
        np.testing.assert_allclose((both.x - other.x) / spread, 0.0, atol=0.01)
        np.testing.assert_allclose(both.P / (spread[:, :, None] * spread[:, None, :]), correlation(other.P), atol=1e-3)
        # The noise of the steps and its covariance, both from the adjoint.
        jumps = [np.einsum("kij,kj->ki", run.Qd, result.before) for result in (both, other)]
        np.testing.assert_allclose(*jumps, rtol=1e-3, atol=1e-4 * np.abs(jumps[1]).max())
        known = [run.Qd @ result.Before @ run.Qd for result in (both, other)]
        np.testing.assert_allclose(*known, rtol=1e-3, atol=1e-4 * run.Qd.max())
    # What the whole record says is not less than what its past says, but for the digits that a double has.
    assert (np.diagonal(both.P, axis1=1, axis2=2) <= np.diagonal(run.P, axis1=1, axis2=2) * (1 + 1e-6)).all()


def integrators(n: int) -> Model:
    """A damped chain of n integrators of which the last in line is measured."""
    names = [f"x{i}" for i in range(n)]
    rates = dict(zip(names, [*names[1:], f"-0.5*{names[-1]} - 0.3*x0"], strict=True))
    return Model("integrators", rates, outputs={"y": Output("x0", "y")})


def followed(model: Model, first: float, noise: float, seed: int) -> tuple[Array, Array, Array]:
    """Errors over their own deviations of filter and smoother, (300, n) each, of the model's own data with sensor sd
    0.01, told that the first state has a variance; and the deviations at the end.
    """
    n, rng, t = len(model.states), np.random.default_rng(seed), 0.05 * np.arange(300)
    density = np.zeros(n)
    density[-1] = noise
    x = [rng.standard_normal(n)]
    for k in range(1, len(t)):
        x.append(model.step(t[k - 1], x[-1], (), 0.05) + np.sqrt(0.05 * density) * rng.standard_normal(n))
    record = Record(t, np.zeros((300, 0)), np.array(x)[:, :1] + 0.01 * rng.standard_normal((300, 1)))
    run = filtered(model, record, np.zeros(n), first * np.eye(n), density, np.array([1e-4]))
    assert run.failed_at is None
    both = smoothed(run)
    sds = [np.sqrt(np.diagonal(P, axis1=1, axis2=2)) for P in (run.P, both.P)]
    return (run.x - x) / sds[0], (both.x - x) / sds[1], sds[0][-1]


@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_prior_that_a_double_cannot_hold_is_one_that_says_nothing(n: int, noise: float) -> None:
    """Up to 10^28 times the sensor's variance: errors are of the size that is stated, and nothing is better known at
    the end for it; it may forget n - 1 of the 300 samples.
    """
    model, ends = integrators(n), []
    for ratio in (1e6, 1e12, 1e15, 1e18, 1e22, 1e28):
        found = [followed(model, 1e-4 * ratio, noise, seed) for seed in range(6)]
        for errors in (
            np.array([filtering for filtering, _, _ in found]),
            np.array([smoothing for _, smoothing, _ in found]),
        ):
            assert np.sqrt(np.mean(errors**2)) < 1.3
            assert np.abs(errors).max() < 5.0
        ends.append(found[0][2])
    assert np.min(ends / ends[0]) > 1.0 - 1e-4
    assert np.max(ends / ends[0]) < 1.05


# Those of filterpy are as they are.
OURS = sorted(name for name, e in plugins.estimators().items() if type(e).__module__.startswith("estimators."))


@pytest.mark.parametrize("name", OURS)
@pytest.mark.parametrize("wide", WIDE)
def test_an_estimator_gives_covariances_or_says_that_it_cannot(
    plants: SimpleNamespace, name: str, wide: tuple[float, float, float]
) -> None:
    found: Any = plugins.estimators()[name].estimate(plants.OSCILLATOR, swinging(priors(*wide), 100))
    assert found.status == "ok" or found.note
    if found.status == "ok":
        assert np.isfinite(found.x).all()
        for P in (found.P, found.P_d):
            assert P is None or indefinite(P) < ROUNDING


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("system", ["OSCILLATOR", "PENDULUM"])
def test_a_covariance_is_one_after_a_million_samples(plants: SimpleNamespace, system: str, noise: float) -> None:
    model: Model = getattr(plants, system)
    record = swinging(priors(1.0, 1e-4, noise), 1_000_000)
    run = passed(model, Record(record.t, np.zeros((len(record), len(model.inputs))), record.y, prior=record.prior))
    assert indefinite(run.P) < ROUNDING
    if noise == 0.0:
        # A damped state of a model without noise is known ever better.
        assert run.P[-1, 0, 0] < 1e-2 * run.P[1000, 0, 0]


def exact(P: Array, h: Array, R: float) -> tuple[list[list[Fraction]], Fraction]:
    """P - P h' h P / s and s in whole numbers over whole numbers."""
    whole = [[Fraction(value) for value in row] for row in P.tolist()]
    slopes = [Fraction(value) for value in h.tolist()]
    gain = [sum((a * b for a, b in zip(row, slopes, strict=True)), Fraction(0)) for row in whole]
    s = sum((a * b for a, b in zip(gain, slopes, strict=True)), Fraction(R))
    n = range(len(gain))
    return [[whole[i][j] - gain[i] * gain[j] / s for j in n] for i in n], s


def covariance(rng: np.random.Generator, n: int, decades: float) -> Array:
    """With eigenvalues over so many decades."""
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
    P = (turn * 10.0 ** rng.uniform(-decades, 0.0, n)) @ turn.T
    return 0.5 * (P + P.T)


@given(st.integers(1, 6), st.integers(0, 2**32 - 1), st.floats(-12.0, 2.0))
@settings(max_examples=60, deadline=None)
def test_an_update_by_factors_is_the_update(n: int, seed: int, sensor: float) -> None:
    rng = np.random.default_rng(seed)
    P, h, R = covariance(rng, n, 2.0), rng.standard_normal(n), 10.0**sensor
    after, U, gain = P.copy(), np.zeros((n, n)), np.zeros(n)
    s = measured(after, h, R, 0.0, U, gain)
    right, variance = exact(P, h, R)
    assert s == pytest.approx(float(variance), rel=1e-12)
    np.testing.assert_allclose(gain, P @ h, atol=1e-13)
    np.testing.assert_allclose(after, np.array(right, dtype=float), atol=1e-14)
    # Along the sensor nothing but the sensor's own variance is left, to nearly all digits however sharp it is.
    assert h @ after @ h == pytest.approx(R * (1.0 - R / s), rel=1e-9, abs=1e-14)
    assert indefinite(after) < ROUNDING


@given(st.integers(1, 6), st.integers(0, 2**32 - 1), st.floats(-4.0, 14.0))
@settings(max_examples=60, deadline=None)
def test_information_by_factors_is_added(n: int, seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    P, L = covariance(rng, n, 2.0), 10.0**size * covariance(rng, n, 2.0)
    U, M, out = (np.zeros((n, n)) for _ in range(3))
    informed(P, L, U, M, out)
    np.testing.assert_allclose(out, np.linalg.inv(np.linalg.inv(P) + L), atol=1e-9 * np.abs(out).max())
    assert indefinite(out) < ROUNDING


def test_factors_of_a_known_state_leave_it_known() -> None:
    P = np.array([[0.0, 0.0, 0.0], [0.0, 4.0, 1.0], [0.0, 1.0, 3.0]])
    U, again, gain = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    factor(P, U, 0.0)
    product(U, again)
    np.testing.assert_allclose(again, P, atol=1e-15)
    assert measured(P, np.array([1.0, 0.0, 0.0]), 1.0, 1e-15, U, gain) == 1.0
    np.testing.assert_array_equal(P[0], 0.0)
    informed(P, np.diag([1e30, 1.0, 0.0]), U, again, out := np.zeros((3, 3)))
    np.testing.assert_array_equal(out[0], 0.0)
    assert indefinite(out) < ROUNDING


def test_factors_that_are_not_positive_are_not_kept() -> None:
    U, P = np.zeros((2, 2)), np.zeros((2, 2))
    factor(np.array([[1.0, 1.0 + 1e-12], [1.0 + 1e-12, 1.0]]), U, 0.0)
    product(U, P)
    assert indefinite(P) == 0.0


def test_a_sensor_without_noise_leaves_nothing_unknown() -> None:
    P, U, gain = np.array([[4.0, 1.0], [1.0, 3.0]]), np.zeros((2, 2)), np.zeros(2)
    assert measured(P, np.array([1.0, 1.0]), 0.0, 0.0, U, gain) == 9.0
    np.testing.assert_allclose(P @ [1.0, 1.0], 0.0, atol=1e-15)
    assert P[0, 0] == pytest.approx(11.0 / 9.0)
