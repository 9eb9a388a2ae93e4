"""The small dense matrices of the kernels against scipy's."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm, solve_continuous_are

from suite.kernels.matrix import exponential, fastest, flow_workspace, solve, transition_flow

Array = npt.NDArray[np.float64]


def scratch(n: int, count: int) -> list[Array]:
    return [np.zeros((n, n)) for _ in range(count)]


@pytest.mark.parametrize("n", [1, 2, 7, 40])
@pytest.mark.parametrize("size", [1e-8, 0.4, 5.0, 40.0])
def test_the_exponential_is_scipys(n: int, size: float) -> None:
    A = np.random.default_rng(n).standard_normal((n, n)) * size / np.sqrt(n)
    E, *work = scratch(n, 5)
    exponential(A.copy(), E, *work)
    expected = expm(A)
    np.testing.assert_allclose(E, expected, atol=1e-12 * float(np.abs(expected).max()))


def test_an_exponential_that_would_overflow_is_not_a_number() -> None:
    E, *work = scratch(2, 5)
    exponential(np.diag([1e7, 1.0]), E, *work)
    assert np.isnan(E).all()


@pytest.mark.parametrize("n", [1, 3, 20])
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_the_speed_of_a_gain_is_bounded_from_above_and_closely_in_any_units(n: int, scale: float) -> None:
    rng = np.random.default_rng(n)
    A, half = rng.standard_normal((2, n, n))
    units = np.diag(scale ** rng.uniform(-1.0, 1.0, n))
    A, B = units @ (A + A.T) @ units, np.linalg.solve(units, half @ half.T) @ np.linalg.inv(units)
    true = float(np.abs(np.linalg.eigvals((A + A.T) / 2.0 @ (B + B.T) / 2.0)).max())
    bound = fastest(A, B, *scratch(n, 2))
    assert true * (1.0 - 1e-6) <= bound <= true * n**0.125 * (1.0 + 1e-6)


def test_a_gain_of_zero_has_no_speed_and_one_that_escapes_an_infinite_one() -> None:
    assert fastest(np.zeros((3, 3)), np.eye(3), *scratch(3, 2)) == 0.0
    assert fastest(np.eye(3) * 1e200, np.eye(3), *scratch(3, 2)) == np.inf


def test_a_singular_system_is_refused() -> None:
    assert solve(np.ones((2, 2)), np.eye(2)) == 0
    A, X = np.array([[0.0, 2.0], [1.0, 3.0]]), np.array([[1.0, 0.5], [2.0, -1.0]])
    expected = np.linalg.solve(A, X)
    assert solve(A.copy(), X) == 1
    np.testing.assert_allclose(X, expected)


@pytest.mark.parametrize("n", [1, 4, 12])
def test_the_flow_of_the_riccati_equation_settles_to_its_algebraic_solution(n: int) -> None:
    rng = np.random.default_rng(n)
    F, root = rng.standard_normal((2, n, n)) / np.sqrt(n)
    W, B = np.eye(n), root @ root.T + np.eye(n)
    S, half, end = np.eye(n), *scratch(n, 2)
    for _ in range(60):
        assert transition_flow(F, W, B, S, 0.5, half, end, flow_workspace(n)) == 1
        S = end.copy()
    # 0 = F S + S F' - S B S + W is the Riccati equation of (F', H') with B = H' H.
    expected = solve_continuous_are(F.T, np.linalg.cholesky(B), W, np.eye(n))
    np.testing.assert_allclose(S, expected, rtol=1e-8, atol=1e-10)
