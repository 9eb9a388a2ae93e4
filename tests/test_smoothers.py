"""The smoothers are the exact conditional mean: as dense algebra, RTS and a boundary-value solver have it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from estimators.disturbance_smoother import RandomWalkSmoother
from estimators.minimum_model_error import MinimumModelError
from suite.case import Case, Experiment
from suite.filtering import filtered
from suite.model import Initial, Model, Output, Parameter
from suite.record import Prior, Record
from suite.smoothing import smoothed

OSCILLATOR = Model(
    name="driven oscillator",
    states={"x1": "2.5*cos(t) - a1*x1 - a2*x2", "x2": "x1"},
    parameters={"a1": Parameter(0.68), "a2": Parameter(1.0)},
    outputs={"z1": Output("x1 + 0.5*x2", "z1"), "z2": Output("x2", "z2")},
    initial={"x1": Initial(0.0), "x2": Initial(0.0)},
)
PRIOR = Prior(np.array([0.1, 0.2]), np.diag([0.3, 0.1]), np.array([0.02, 0.01]), np.array([0.4, 0.1]))


def record_of(model: Model, noise: float = 0.1, duration: float = 2.0, missing: float = 0.2) -> Record:
    """The oscillator, both outputs, with a share of the samples missing."""
    record, _ = Case("linear", "", model, model, Experiment(duration, 0.1, (0.0, 0.0))).simulate(noise, 5)
    y = record.y.copy()
    y[np.random.default_rng(1).random(y.shape) < missing] = np.nan
    return Record(record.t, record.u, y, prior=PRIOR)


def dense(record: Record, x0: np.ndarray, P0: np.ndarray, Q: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, ...]:
    """Posterior mean and covariance of all states of the linear plant given all data, and the data's log density."""
    N, n = len(record), 2
    H = OSCILLATOR.output_jacobian(0.0, np.zeros(2))
    mean, C = np.zeros((N, n)), np.zeros((N, n, N, n))
    mean[0], C[0, :, 0, :] = x0, P0
    for k in range(1, N):
        dt = record.t[k] - record.t[k - 1]
        mean[k], Phi = OSCILLATOR.transition(record.t[k - 1], mean[k - 1], (), dt)
        C[k, :, :k] = np.einsum("ij,jkl->ikl", Phi, C[k - 1][:, :k])
        C[:k, :, k, :] = C[k, :, :k].transpose(1, 2, 0)
        C[k, :, k, :] = Phi @ C[k - 1, :, k - 1, :] @ Phi.T + np.diag(Q) * dt
    m, V = mean.ravel(), C.reshape(N * n, N * n)
    seen = ~np.isnan(record.y).ravel()
    A = np.kron(np.eye(N), H)[seen]
    S = A @ V @ A.T + np.diag(np.tile(R, N)[seen])
    e = record.y.ravel()[seen] - A @ m
    K = np.linalg.solve(S, A @ V).T
    density = -0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(S)[1])
    return (m + K @ e).reshape(N, n), (V - K @ A @ V).reshape(N, n, N, n), np.array(density)


@pytest.mark.parametrize(("P0", "Q"), [(np.diag([0.3, 0.1]), (0.4, 0.1)), (np.zeros((2, 2)), (0.4, 0.0))])
def test_the_smoother_is_the_conditional_mean(P0: np.ndarray, Q: tuple[float, float]) -> None:
    """States, covariances and likelihood equal dense Gaussian conditioning to 1e-9, also for singular P0 and Q."""
    record, q = record_of(OSCILLATOR), np.array(Q)
    run = filtered(OSCILLATOR, record, PRIOR.x0, P0, q, PRIOR.R)
    result = smoothed(run)
    mean, C, density = dense(record, PRIOR.x0, P0, q, PRIOR.R)
    np.testing.assert_allclose(result.x, mean, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(result.P, np.einsum("kikj->kij", C), rtol=0.0, atol=1e-9)
    assert run.log_likelihood == pytest.approx(float(density), rel=1e-9)


def test_the_smoothed_noise_closes_the_dynamics() -> None:
    """x(k) = Phi x(k-1) + known part + w(k) holds for the smoothed states and noise to 1e-10, and P_w is theirs."""
    record = record_of(OSCILLATOR)
    run = filtered(OSCILLATOR, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    result = smoothed(run)
    _, C, _ = dense(record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    for k in range(1, len(record)):
        moved, Phi = OSCILLATOR.transition(record.t[k - 1], result.x[k - 1], (), record.t[k] - record.t[k - 1])
        np.testing.assert_allclose(run.Qd[k] @ result.before[k], result.x[k] - moved, rtol=0.0, atol=1e-10)
        L = np.hstack([-Phi, np.eye(2)])
        joint = C[k - 1 : k + 1][:, :, k - 1 : k + 1].reshape(4, 4)
        np.testing.assert_allclose(
            run.Qd[k] - run.Qd[k] @ result.Before[k] @ run.Qd[k], L @ joint @ L.T, rtol=0.0, atol=1e-9
        )


def test_batch_is_the_rts_smoother() -> None:
    """On a linear plant minimum model error gives the states of Rauch, Tung and Striebel's recursion to 1e-9."""
    record = record_of(OSCILLATOR, duration=5.0)
    found = MinimumModelError().estimate(OSCILLATOR, record)
    run = filtered(OSCILLATOR, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R, spread=True)
    x, P = run.x.copy(), run.P.copy()
    for k in range(len(record) - 2, -1, -1):
        G = run.P[k] @ run.Phi[k + 1].T @ np.linalg.inv(run.P_prior[k + 1])
        x[k] += G @ (x[k + 1] - run.x_prior[k + 1])
        P[k] += G @ (P[k + 1] - run.P_prior[k + 1]) @ G.T
    np.testing.assert_allclose(found.x, x, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.P, P, rtol=0.0, atol=1e-9)


def test_a_smoother_ends_as_its_filter() -> None:
    """At the last sample smoothed and filtered state and covariance are the same."""
    record = record_of(OSCILLATOR)
    run = filtered(OSCILLATOR, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    result = smoothed(run)
    np.testing.assert_array_equal(result.x[-1], run.x[-1])
    np.testing.assert_allclose(result.P[-1], run.P[-1], rtol=0.0, atol=1e-15)
    assert np.all(np.linalg.eigvalsh(run.P - result.P) > -1e-12)


def test_minimum_model_error_solves_the_boundary_value_problem() -> None:
    """On a nonlinear plant x and d follow scipy's solve_bvp of x' = f + d, lambda' = -f_x lambda - H' R^-1 (z - h)
    within 1e-5 and 1e-4 of their size; near the end to first order in the step, as the last reading counts in full.
    """
    model = Model(
        name="cubic decay",
        states={"x": "-0.5*x - 0.3*x**3"},
        outputs={"z": Output("x", "z")},
        initial={"x": Initial(1.0)},
        suspect=("x",),
    )
    t = np.arange(0.0, 5.0 + 1e-9, 0.005)
    z = np.cos(1.3 * t) + 0.2 * t
    q, R = 2.0, 0.1
    prior = Prior(np.ones(1), np.zeros((1, 1)), np.array([R / 0.005]), np.array([q]))
    record = Record(t, np.zeros((len(t), 0)), z[:, None], prior=prior)
    found = MinimumModelError().estimate(model, record)

    def slope(s: np.ndarray, v: np.ndarray) -> np.ndarray:
        x, l = v
        e = np.cos(1.3 * s) + 0.2 * s - x
        return np.array([-0.5 * x - 0.3 * x**3 + q * l, (0.5 + 0.9 * x**2) * l - e / R])

    exact = solve_bvp(
        slope, lambda a, b: np.array([a[0] - 1.0, b[1]]), t, np.array([z, np.zeros_like(t)]), tol=1e-8, max_nodes=50_000
    )
    assert exact.success
    x, d = exact.sol(t)[0], q * exact.sol(t)[1]
    error_x, error_d = np.abs(found.x[:, 0] - x) / np.abs(x).max(), np.abs(found.d[:, 0] - d) / np.abs(d).max()
    early = (t > 0.0) & (t < 3.5)
    assert error_x[early].max() < 1e-5
    assert error_d[early].max() < 1e-4
    assert error_x.max() < 5e-3
    assert error_d[1:].max() < 2e-2
    assert found.status == "ok"


def test_minimum_model_error_knows_its_error() -> None:
    """P_d is what dense Gaussian conditioning on the readings leaves of the mean model error over each step (its two
    kicks, half at the start and half at the end of the step), so that it has no negative eigenvalue; the first
    sample, at which no step ends, has that of the first step.
    """
    record = record_of(OSCILLATOR)
    N, n = len(record), 2
    H = OSCILLATOR.output_jacobian(0.0, np.zeros(2))
    # The unknowns in order: the first state, then each step's two kicks; `reach` makes a state of them.
    V = np.zeros((n + 2 * n * (N - 1),) * 2)
    V[:n, :n] = PRIOR.P0
    reach, rows = np.zeros((n, len(V))), []
    reach[:, :n] = np.eye(n)
    rows.append(reach)
    for k in range(1, N):
        dt = record.t[k] - record.t[k - 1]
        Phi = OSCILLATOR.transition(record.t[k - 1], np.zeros(2), (), dt)[1]
        start, end = (slice(n + n * (2 * (k - 1) + half), n + n * (2 * (k - 1) + half + 1)) for half in (0, 1))
        V[start, start] = V[end, end] = np.diag(PRIOR.Q) * dt / 2
        reach = reach.copy()
        reach[:, start] += np.eye(n)
        reach = Phi @ reach
        reach[:, end] += np.eye(n)
        rows.append(reach)
    seen = ~np.isnan(record.y).ravel()
    A = np.concatenate([H @ part for part in rows])[seen]
    left = V - V @ A.T @ np.linalg.solve(A @ V @ A.T + np.diag(np.tile(PRIOR.R, N)[seen]), A @ V)
    P_d = MinimumModelError().estimate(OSCILLATOR, record).P_d
    assert P_d is not None
    for k in range(1, N):
        first = n + 2 * n * (k - 1)
        kicks = left[first : first + 2 * n, first : first + 2 * n].reshape(2, n, 2, n).sum(axis=(0, 2))
        np.testing.assert_allclose(P_d[k], kicks / (record.t[k] - record.t[k - 1]) ** 2, rtol=1e-8, atol=1e-10)
    np.testing.assert_array_equal(P_d[0], P_d[1])
    assert np.linalg.eigvalsh(P_d).min() > 0.0


def test_the_random_walk_smoother_knows_its_error() -> None:
    """A constant disturbance is recovered: within three of the standard deviations that P_d states, at most samples."""
    pushed = OSCILLATOR.plus("x1", "+0.8", {})
    case = Case("pushed", "", OSCILLATOR, pushed, Experiment(20.0, 0.1, (0.0, 0.0)))
    record, truth = case.simulate(0.05, 2)
    record = record.with_prior(Prior(np.zeros(2), np.zeros((2, 2)), truth.noise**2, np.array([0.1, 0.0])))
    found = RandomWalkSmoother().estimate(OSCILLATOR, record)
    assert found.P_d is not None
    assert found.d is not None
    error, sd = found.d[:, 0] - 0.8, np.sqrt(found.P_d[:, 0, 0])
    assert np.mean(np.abs(error) < 3.0 * sd) > 0.95
    assert np.mean(sd) < 0.4
    assert np.all(found.d[:, 1] == 0.0)
