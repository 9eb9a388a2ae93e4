"""Invariant embedding is a Kalman filter with P = 2S, and reproduces the published example."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from estimators.conventional_ie import ConventionalIE, ConventionalIEDiscrete
from estimators.generalized_ie import GeneralizedIE, GeneralizedIEDiscrete
from estimators.sra import SemiRobustAdaptive, SemiRobustAdaptiveDiscrete
from suite.case import Case, Experiment
from suite.filtering import filtered, rates
from suite.model import Initial, Model, Output, Parameter
from suite.record import Prior, Record
from suite.robustness import norm

# The plant of Raol (2016), (100)-(101).
LINEAR = Model(
    name="driven oscillator",
    states={"x1": "2.5*cos(t) - a1*x1 - a2*x2", "x2": "x1"},
    parameters={"a1": Parameter(0.68), "a2": Parameter(1.0)},
    outputs={"z1": Output("x1", "z1")},
    initial={"x1": Initial(0.0), "x2": Initial(0.0)},
)
CUBIC = LINEAR.plus("x1", "-a3*x2**3", {"a3": Parameter(0.0195)})
STRONG = CUBIC.with_values({"a3": 0.5})
PRIOR = Prior(np.array([0.3, -0.2]), np.diag([0.2, 0.1]), np.array([0.04]), np.array([0.05, 0.02]))


def experiment(model: Model, noise: float = 0.1, duration: float = 5.0) -> Record:
    """The cubic plant, x1 measured, with what an estimator may know."""
    case = Case("paper", "", model, CUBIC, Experiment(duration, 0.05, (0.0, 0.0)))
    return case.simulate(noise, 3)[0].with_prior(PRIOR)


def coefficient(x: np.ndarray, d: np.ndarray) -> float:
    """a3 of d1 = -a3 x2^3 by least squares."""
    cube = x[:, 1] ** 3
    return float(-cube @ d[:, 0] / (cube @ cube))


@pytest.mark.parametrize(("alpha", "a3", "J"), [(1.0, 0.01819, 0.0012036), (0.1365, 0.01879, 0.0001669)])
def test_the_reconstruction_of_table_1(alpha: float, a3: float, J: float) -> None:
    """a3 and J of Table 1's reconstruction (one of many) are met within 1 %, by either Riccati solution."""
    record = experiment(LINEAR, noise=0.0, duration=14.0).with_prior(
        Prior(np.zeros(2), np.zeros((2, 2)), np.ones(1), np.array([1.0, 0.0]))
    )
    for riccati in ("transition", "integration"):
        found = GeneralizedIE().estimate(
            LINEAR, record, alpha=alpha, riccati=riccati, Q=np.array([0.004, 0.4]), R=np.ones(1), S0=50.0 * np.eye(2)
        )
        assert found.status == "ok"
        assert found.J is not None
        assert coefficient(found.x, found.d) == pytest.approx(a3, rel=0.01)
        assert sum(found.J) == pytest.approx(J, rel=0.01)


def test_discrete_embedding_is_the_extended_kalman_filter() -> None:
    """On a nonlinear plant xhat and 2S of the discrete filter are x and P of the EKF to 1e-10."""
    record = experiment(STRONG)
    found = ConventionalIEDiscrete().estimate(STRONG, record)
    run = filtered(STRONG, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    np.testing.assert_allclose(found.x, run.x, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.P, run.P, rtol=0.0, atol=1e-10)


def kalman_bucy(model: Model, record: Record, R: float, substeps: int) -> tuple[np.ndarray, np.ndarray]:
    """The extended Kalman-Bucy filter in P form: RK4 for x, P by the exponential of its own Hamiltonian."""
    n, t, y = 2, record.t, record.y[:, 0]
    x, P = PRIOR.x0.copy(), PRIOR.P0.copy()
    xs, Ps = [x], [P]
    H = np.array([[1.0, 0.0]])
    for k in range(len(t) - 1):
        h = (t[k + 1] - t[k]) / substeps
        for i in range(substeps):
            now = t[k] + i * h
            F = model.jacobian(now, x)
            # [X; Y]' = [[F, Q], [H' R^-1 H, -F']] [X; Y], P = X Y^-1
            E = expm(np.block([[F, np.diag(PRIOR.Q)], [H.T @ H / R, -F.T]]) * h / 2)
            Ph = (E[:n, :n] @ P + E[:n, n:]) @ np.linalg.inv(E[n:, :n] @ P + E[n:, n:])
            Pe = (E[:n, :n] @ Ph + E[:n, n:]) @ np.linalg.inv(E[n:, :n] @ Ph + E[n:, n:])

            def slope(offset: float, at: np.ndarray, cov: np.ndarray, now: float = now, k: int = k) -> np.ndarray:
                z = y[k] + (now + offset - t[k]) / (t[k + 1] - t[k]) * (y[k + 1] - y[k])
                return model.rate(now + offset, at) + cov @ H[0] * (z - at[0]) / R

            k1 = slope(0.0, x, P)
            k2 = slope(h / 2, x + h / 2 * k1, Ph)
            k3 = slope(h / 2, x + h / 2 * k2, Ph)
            k4 = slope(h, x + h * k3, Pe)
            x, P = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), Pe
        xs.append(x)
        Ps.append(P)
    return np.array(xs), np.array(Ps)


def test_continuous_embedding_is_the_extended_kalman_bucy_filter() -> None:
    """With the same substeps xhat and 2S are x and P of the Kalman-Bucy recursion to 1e-10, on a nonlinear plant."""
    record = experiment(STRONG)
    found = ConventionalIE().estimate(STRONG, record, R=np.array([0.02]))
    x, P = kalman_bucy(STRONG, record, 0.02, 4)
    np.testing.assert_allclose(found.x, x, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.P, P, rtol=0.0, atol=1e-10)


def test_continuous_embedding_solves_the_kalman_bucy_equations() -> None:
    """On a linear plant it solves the filter's own ODE (scipy, 1e-10) within 1e-6: RK4's error at four substeps."""
    record = experiment(LINEAR, duration=2.0)
    R, H = 0.02, np.array([1.0, 0.0])

    def slope(t: float, s: np.ndarray) -> np.ndarray:
        x, P = s[:2], s[2:].reshape(2, 2)
        F = LINEAR.jacobian(t, x)
        gain = P @ H / R
        dP = F @ P + P @ F.T + np.diag(PRIOR.Q) - np.outer(gain, H @ P)
        z = np.interp(t, record.t, record.y[:, 0])
        return np.concatenate([LINEAR.rate(t, x) + gain * (z - x[0]), dP.ravel()])

    found = GeneralizedIE().estimate(LINEAR, record, R=np.array([R]))
    assert found.P is not None
    s = np.concatenate([PRIOR.x0, PRIOR.P0.ravel()])
    for k in range(len(record) - 1):
        s = solve_ivp(slope, record.t[k : k + 2], s, rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(found.x[k + 1], s[:2], rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(found.P[k + 1].ravel(), s[2:], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("method", [GeneralizedIE(), GeneralizedIEDiscrete()])
def test_alpha_only_scales_the_weight(method: GeneralizedIE) -> None:
    """J(alpha, Q) = J(1, alpha Q): estimates and cost are the same."""
    record = experiment(LINEAR)
    one = method.estimate(LINEAR, record, alpha=7.0, q_scale=2.0)
    other = method.estimate(LINEAR, record, alpha=1.0, q_scale=14.0)
    assert pytest.approx(other.J, rel=1e-12) == one.J
    np.testing.assert_allclose(one.d, other.d, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(one.x, other.x, rtol=1e-10, atol=1e-12)


def test_the_riccati_equation_is_solved_alike_by_both_methods() -> None:
    """Transition matrix and integration agree to 1e-6, and stay finite where one RK4 step a sample would not."""
    record = experiment(LINEAR)
    stiff = {"S0": 1e6 * np.eye(2), "R": np.array([1e-3])}
    one = GeneralizedIE().estimate(LINEAR, record, riccati="transition", **stiff)
    other = GeneralizedIE().estimate(LINEAR, record, riccati="integration", **stiff)
    assert one.status == other.status == "ok"
    np.testing.assert_allclose(one.x[5:], other.x[5:], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(one.P[5:], other.P[5:], rtol=1e-5, atol=1e-6)


def test_the_jump_that_a_constant_disturbance_makes_becomes_that_disturbance() -> None:
    """Integrating e^(F s) d over a step and dividing again gives d to 1e-7 (RK4's error), where jump / dt does not."""
    d = np.array([0.7, -0.4])
    pushed = LINEAR.plus("x1", "+0.7", {}).plus("x2", "-0.4", {})
    record = experiment(LINEAR)
    x = np.tile([0.5, -1.0], (len(record), 1))
    jumps = np.zeros_like(x)
    for k in range(1, len(record)):
        step = record.t[k] - record.t[k - 1]
        jumps[k] = pushed.step(record.t[k - 1], x[k - 1], (), step) - LINEAR.step(record.t[k - 1], x[k - 1], (), step)
    found = rates(LINEAR, record, x, jumps)
    np.testing.assert_allclose(found[1:], np.tile(d, (len(record) - 1, 1)), rtol=0.0, atol=1e-7)
    assert np.max(np.abs(jumps[1:] / 0.05 - d)) > 1e-3


@pytest.mark.parametrize("pace", [0.1, 1.0, 4.0, 60.0])
def test_a_jump_is_made_a_rate_by_the_integral_of_the_exponential(pace: float) -> None:
    """G d = jump to 1e-9 of what scipy's exponential gives, for a turning plant slow or fast against its sampling.

    Above 2 pi (pace 60: an angle of 12 a sample) the series does not converge and the exponential itself is used.
    """
    dt = 0.2
    model = Model(
        "turning", {"a": f"{pace}*b - 0.3*a", "b": f"-{pace}*a + c", "c": "-c"}, outputs={"a": Output("a", "a")}
    )
    N = 6
    record = Record(np.arange(N) * dt, np.zeros((N, 0)), np.zeros((N, 1)))
    jumps = np.random.default_rng(1).standard_normal((N, 3))
    F = model.jacobian(0.0, np.zeros(3))
    both = np.zeros((6, 6))
    both[:3, :3], both[:3, 3:] = F * dt, np.eye(3) * dt
    wanted = np.linalg.solve(expm(both)[:3, 3:], jumps[1:].T).T
    found = rates(model, record, np.zeros((N, 3)), jumps)
    np.testing.assert_allclose(found[1:], wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
    assert not found[0].any()


def test_the_residual_after_the_update_fades_with_the_weight() -> None:
    """As alpha Q -> 0 dhat of (95) as printed goes to 0, and dhat of the residual before the update does not."""
    record = experiment(LINEAR)
    size = {
        (residual, q): np.abs(ConventionalIEDiscrete().estimate(LINEAR, record, q_scale=q, residual=residual).d).max()
        for residual in ("before", "after")
        for q in (1e-4, 1e-6)
    }
    assert size["after", 1e-6] < 0.05 * size["after", 1e-4]
    assert size["before", 1e-6] > 0.9 * size["before", 1e-4]


@pytest.mark.parametrize("method", [GeneralizedIE(), GeneralizedIEDiscrete()])
def test_without_measurements_the_filter_is_the_model(method: GeneralizedIE) -> None:
    """Where every sample is missing xhat is the simulated model and dhat is 0."""
    record = experiment(LINEAR)
    record = Record(record.t, record.u, np.full_like(record.y, np.nan), prior=PRIOR)
    found = method.estimate(LINEAR, record)
    x = PRIOR.x0
    for k in range(len(record) - 1):
        x = LINEAR.step(record.t[k], x, (), record.t[k + 1] - record.t[k])
    np.testing.assert_allclose(found.x[-1], x, rtol=0.0, atol=1e-6)
    assert np.all(found.d == 0.0)


@pytest.mark.parametrize(
    ("H", "expected"), [(np.eye(2), 2.112), (np.array([[0.0, 1.0]]), 1.564), (np.array([[1.0, 0.0]]), 1.471)]
)
def test_the_threshold_of_the_published_plant(H: np.ndarray, expected: float) -> None:
    """The H-infinity norm of the paper's plant from d1 to both states, to x2, to x1, is 2.112, 1.564, 1.471."""
    F = LINEAR.jacobian(0.0, np.zeros(2))
    assert norm(F, np.array([[1.0], [0.0]]), H) == pytest.approx(expected, abs=1e-3)
    assert norm(np.array([[0.0]]), np.eye(1), np.eye(1)) == float("inf")


def test_sra_says_how_long_it_exists() -> None:
    """With a huge gamma S keeps its definiteness; a small one loses it, at the time reported, or escapes."""
    weak = Prior(PRIOR.x0, PRIOR.P0, PRIOR.R, np.array([0.05, 0.0]))
    record = experiment(LINEAR).with_prior(weak)
    for method in (SemiRobustAdaptive(), SemiRobustAdaptiveDiscrete()):
        huge = method.estimate(LINEAR, record, gamma_ratio=1e4)
        small = method.estimate(LINEAR, record, gamma_ratio=0.5)
        assert huge.status == "ok"
        assert huge.report is not None
        assert huge.report["exists until"] == record.t[-1]
        # d1 to x1 with q = 0.05 and R = 0.04 dt: 1.471 sqrt(q / R)
        assert huge.report["threshold"] == pytest.approx(1.4706 * (0.05 / (0.04 * 0.05)) ** 0.5, rel=1e-3)
        assert small.status != "ok"
        assert "lost definiteness at t =" in small.note
        assert small.report is not None
        assert 0.0 < float(small.report["exists until"]) < record.t[-1]
        assert small.J is None or small.J[1] <= 0.0
        assert np.all(np.isfinite(small.x))
        assert np.all(np.isfinite(small.d))
