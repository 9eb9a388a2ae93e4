"""The further estimators keep the contract, and each is what its equations say, by an independent computation."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import least_squares

from estimators._predictive import prediction
from estimators.disturbance_filter import RandomWalkFilter
from estimators.disturbance_smoother import RandomWalkSmoother
from estimators.h_infinity import CentralHInfinity
from estimators.integrated_disturbance_filter import IntegratedWalkFilter
from estimators.integrated_disturbance_smoother import IntegratedWalkSmoother
from estimators.moving_horizon import MovingHorizon
from estimators.predictive_filter import PredictiveFilter
from suite import plugins
from suite.case import Case, Experiment
from suite.disturbance import with_integrated_walk, with_random_walk
from suite.errors import DataError
from suite.estimator import Estimator
from suite.filtering import filtered
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Prior, Record

QUICK: list[Estimator] = [
    RandomWalkFilter(), IntegratedWalkFilter(), IntegratedWalkSmoother(), PredictiveFilter(), CentralHInfinity(),
]  # fmt: skip
METHODS: list[Estimator] = [*QUICK, MovingHorizon()]

OSCILLATOR = Model(
    name="oscillator",
    states={"p": "v", "v": "-c*v - 2*p"},
    parameters={"c": Parameter(0.3)},
    outputs={"p": Output("p", "p"), "s": Output("v + 0.5*p", "s")},
    initial={"p": Initial(1.0), "v": Initial(0.0)},
)
PENDULUM = Model(
    name="driven pendulum",
    states={"angle": "rate", "rate": "F - c*rate - k*sin(angle)"},
    parameters={"c": Parameter(0.3), "k": Parameter(2.0)},
    inputs={"F": Input("F", "linear")},
    outputs={"a": Output("angle", "a", angle=True), "r": Output("rate", "r")},
    initial={"angle": Initial(0.0), "rate": Initial(0.0)},
)
PRIOR = Prior(np.array([0.9, 0.1]), np.diag([0.3, 0.1]), np.array([0.02, 0.01]), np.array([0.0, 0.4]))
A = np.array([[0.0, 1.0], [-2.0, -0.3]])
H = np.array([[1.0, 0.0], [0.5, 1.0]])


def record_of(model: Model, samples: int = 41, dt: float = 0.05, gaps: bool = True) -> Record:
    """Uneven steps, the model driven by what it lacks (a slow force), noise, and a fifth of the readings missing."""
    rng = np.random.default_rng(4)
    t = np.cumsum(dt * rng.uniform(0.5, 1.5, samples))
    force = "F" in model.inputs
    truth = model.plus(list(model.states)[-1], "0.5*sin(0.7*t)")
    u = np.sin(1.5 * t)[:, None] if force else np.zeros((samples, 0))
    x, rows = np.array([0.9, 0.1]), []
    for k in range(samples):
        x = x if k == 0 else truth.step(t[k - 1], x, u[k - 1], t[k] - t[k - 1], u[k])
        rows.append(truth.output(t[k], x, u[k]) + 0.1 * rng.standard_normal(2))
    y = np.array(rows)
    if gaps:
        y[rng.random(y.shape) < 0.2] = np.nan
        y[20:22] = np.nan
    return Record(t, u, y, prior=PRIOR)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_the_contract_holds_with_gaps_and_uneven_steps(method: Estimator) -> None:
    """Shapes, finite numbers, symmetric covariances, unchanged inputs, the same numbers twice, a d that is there."""
    if method.name == "moving-horizon":
        pytest.importorskip("casadi")
    assert plugins.estimators()[method.name].name == method.name
    record = record_of(PENDULUM)
    before = [a.copy() for a in (record.t, record.u, record.y, PRIOR.x0, PRIOR.P0, PRIOR.R, PRIOR.Q)]
    found, again = method.estimate(PENDULUM, record), method.estimate(PENDULUM, record)
    for a, b in zip(before, (record.t, record.u, record.y, PRIOR.x0, PRIOR.P0, PRIOR.R, PRIOR.Q), strict=True):
        np.testing.assert_array_equal(a, b)
    assert found.status == "ok", found.note
    assert found.d is not None
    assert again.d is not None
    for one, two in ((found.x, again.x), (found.d, again.d)):
        assert one.shape == (len(record), 2)
        assert np.all(np.isfinite(one))
        np.testing.assert_array_equal(one, two)
    assert np.ptp(found.d[:, 1]) > 0.0
    for P in (found.P, found.P_d):
        if P is not None:
            np.testing.assert_allclose(P, P.transpose(0, 2, 1), rtol=1e-9, atol=1e-12)
            assert np.linalg.eigvalsh(P).min() > -1e-9
    with pytest.raises(DataError, match="with_prior"):
        method.estimate(PENDULUM, Record(record.t, record.u, record.y))


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_plant_that_explodes_is_told(method: Estimator) -> None:
    """Arrays stay finite and status and note say when the estimate was lost."""
    if method.name == "moving-horizon":
        pytest.importorskip("casadi")
    model = Model(name="explosion", states={"x": "x**3"}, outputs={"z": Output("x", "z")}, suspect=("x",))
    y = np.full((20, 1), np.nan)
    y[0] = 5.0
    prior = Prior(np.array([5.0]), np.eye(1), np.array([1e-2]), np.array([1.0]))
    found = method.estimate(model, Record(np.arange(20) * 0.5, np.zeros((20, 0)), y, prior=prior))
    assert found.status == "diverged"
    assert "t = " in found.note
    assert found.d is not None
    assert np.all(np.isfinite(found.x))
    assert np.all(np.isfinite(found.d))


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_model_without_suspects_and_another_unit(method: Estimator) -> None:
    """Without suspects d is zero; with states and data in thousandths the answer is the same."""
    if method.name == "moving-horizon":
        pytest.importorskip("casadi")
    sound = Model(name="decay", states={"x": "-x"}, outputs={"z": Output("x", "z")}, suspect=())
    t, none = np.arange(15) * 0.1, np.zeros((15, 0))
    prior = Prior(np.ones(1), np.zeros((1, 1)), np.array([1e-4]), np.zeros(1))
    found = method.estimate(sound, Record(t, none, np.exp(-t)[:, None] + 0.01 * np.sin(9.0 * t)[:, None], prior=prior))
    assert found.status == "ok"
    assert found.d is not None
    assert np.all(found.d == 0.0)
    record = record_of(OSCILLATOR)
    scaled = Prior(1e3 * PRIOR.x0, 1e6 * PRIOR.P0, 1e6 * PRIOR.R, 1e6 * PRIOR.Q)
    one = method.estimate(OSCILLATOR, record)
    other = method.estimate(OSCILLATOR, Record(record.t, record.u, 1e3 * record.y, prior=scaled))
    assert one.d is not None
    assert other.d is not None
    np.testing.assert_allclose(other.x / 1e3, one.x, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(other.d / 1e3, one.d, rtol=1e-5, atol=1e-5)


def test_the_filters_end_where_their_smoothers_end() -> None:
    """At the last sample filter and smoother have seen the same: x, d, P and P_d are equal to 1e-9."""
    record = record_of(PENDULUM)
    for forward, both in (
        (RandomWalkFilter(), RandomWalkSmoother()),
        (IntegratedWalkFilter(), IntegratedWalkSmoother()),
    ):
        one, two = forward.estimate(PENDULUM, record), both.estimate(PENDULUM, record)
        for a, b in ((one.x, two.x), (one.d, two.d), (one.P, two.P), (one.P_d, two.P_d)):
            assert a is not None
            assert b is not None
            np.testing.assert_allclose(a[-1], b[-1], rtol=0.0, atol=1e-9)
            assert np.max(np.abs(a[5] - b[5])) > 1e-6


def test_the_integrated_walk_smoother_is_batch_least_squares() -> None:
    """States, d and the deviation of d are those of one dense least-squares problem in all unknowns, to 1e-5."""
    record = record_of(OSCILLATOR)
    _, start = with_integrated_walk(OSCILLATOR, record, PRIOR, 5.0)
    found = IntegratedWalkSmoother().estimate(OSCILLATOR, record, q_scale=5.0)
    # Unknown: the first [p, v, d, slope], and a kick of the slope at the start and at the end of each step.
    driven = np.zeros((4, 4))
    driven[:2, :2], driven[1, 2], driven[2, 3] = A, 1.0, 1.0
    N, kick = len(record), np.array([0.0, 0.0, 0.0, 1.0])
    path = np.zeros((N, 4, 4 + 2 * (N - 1)))
    path[0, :, :4] = np.eye(4)
    deviation = np.sqrt(np.repeat(start.Q[3] * record.dt / 2.0, 2))
    for k in range(1, N):
        before = path[k - 1].copy()
        before[:, 4 + 2 * (k - 1)] += kick
        path[k] = expm(driven * record.dt[k - 1]) @ before
        path[k, :, 5 + 2 * (k - 1)] += kick
    seen = ~np.isnan(record.y)
    rows = np.einsum("ci,kij->kcj", H, path[:, :2]) / np.sqrt(PRIOR.R)[:, None]
    root = np.sqrt(np.concatenate([np.diag(start.P0), deviation**2]))
    system = np.vstack([rows[seen], np.diag(1.0 / root)])
    right = np.concatenate([(record.y / np.sqrt(PRIOR.R))[seen], np.concatenate([start.x0, 0.0 * deviation]) / root])
    best = np.linalg.lstsq(system, right, rcond=None)[0]
    assert found.d is not None
    assert found.P_d is not None
    np.testing.assert_allclose(found.x, path[:, :2] @ best, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(found.d[:, 1], path[:, 2] @ best, rtol=0.0, atol=1e-5)
    C = np.linalg.inv(system.T @ system)
    np.testing.assert_allclose(found.P_d[:, 1, 1], np.einsum("ki,ij,kj->k", path[:, 2], C, path[:, 2]), rtol=1e-4)


def test_an_integrated_walk_follows_a_ramp_without_lag() -> None:
    """Where the model error grows steadily the integrated walk's mean error of d is below a fifth of the walk's."""
    t = np.arange(400) * 0.05
    model = Model(name="decay", states={"x": "-x"}, outputs={"z": Output("x", "z")}, initial={"x": Initial(0.0)})
    x = solve_ivp(lambda s, x: -x + 0.3 * s, (0.0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-9).y.T
    y = x + 0.02 * np.random.default_rng(0).standard_normal(x.shape)
    prior = Prior(np.zeros(1), np.zeros((1, 1)), np.array([4e-4]), np.array([0.05]))
    record = Record(t, np.zeros((400, 0)), y, prior=prior)
    lag = []
    for method in (RandomWalkFilter(), IntegratedWalkFilter()):
        d = method.estimate(model, record).d
        assert d is not None
        lag.append(abs(float(np.mean(0.3 * t[200:] - d[200:, 0]))))
    assert lag[1] < 0.2 * lag[0]


def test_the_predictive_filter_is_its_equations() -> None:
    """x and d equal a filter written with Lie derivatives by hand and an ODE solver, to 1e-6."""
    record = record_of(PENDULUM)
    found = PredictiveFilter().estimate(PENDULUM, record, w_scale=0.3)
    x, xs, ds = PRIOR.x0, [PRIOR.x0], [0.0]
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
        W = 0.3 * dt / PRIOR.Q[1]
        d = float(np.sum((LS * e / PRIOR.R)[seen]) / (np.sum((LS**2 / PRIOR.R)[seen]) + W))
        x = solve_ivp(rate, (t, t + dt), x, args=(d,), rtol=1e-10, atol=1e-12).y[:, -1]
        xs.append(x)
        ds.append(d)
    assert found.d is not None
    np.testing.assert_allclose(found.x, np.array(xs), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.d[:, 1], ds, rtol=0.0, atol=1e-5)


def test_with_exact_measurements_the_predictive_d_is_the_model_error() -> None:
    """Without weight on d its error on a linear plant is that of the expansion: it halves with the step."""
    truth = OSCILLATOR.plus("v", "0.8*cos(2*t)")
    errors = []
    for dt in (0.04, 0.02, 0.01):
        record, _ = Case("exact", "", OSCILLATOR, truth, Experiment(4.0, dt, (1.0, 0.0))).simulate(0.0, 0)
        exact = Prior(np.array([1.0, 0.0]), np.zeros((2, 2)), np.array([1.0, 1e-8]), PRIOR.Q)
        found = PredictiveFilter().estimate(OSCILLATOR, record.with_prior(exact), w_scale=1e-6)
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


def test_the_covariance_constraint_is_met() -> None:
    """With w_scale None the residual variance is R to 3 %, and a smaller weight leaves less of it."""
    record = record_of(OSCILLATOR, 200)
    found = PredictiveFilter().estimate(OSCILLATOR, record, w_scale=None)
    assert found.report is not None
    assert found.report["covariance ratio"] == pytest.approx(1.0, abs=0.03)
    less = PredictiveFilter().estimate(OSCILLATOR, record, w_scale=0.01 * float(found.report["w_scale"]))
    assert less.report is not None
    assert float(less.report["covariance ratio"]) < 0.9


FULL = Prior(PRIOR.x0, PRIOR.P0, PRIOR.R, np.array([0.1, 0.4]))


def central(record: Record, gamma: float, L: np.ndarray) -> tuple[np.ndarray | None, float]:
    """Estimates of the central filter with matrices inverted as written, None where the condition fails; and the
    largest ratio of the error's energy to the disturbances' over all x0, w, v: a singular value of the whole map.
    """
    N = len(record)
    x, P, error, xs, rows = FULL.x0, FULL.P0, np.zeros((2, 2 + 4 * N)), [], []
    error[:, :2] = np.linalg.cholesky(FULL.P0)
    for k in range(N):
        if k > 0:
            dt = record.dt[k - 1]
            F = OSCILLATOR.transition(record.t[k - 1], x, (), dt)[1]
            x, error = F @ x, F @ error
            error[:, 2 + 2 * k : 4 + 2 * k] += np.diag(np.sqrt(FULL.Q * dt))
            P = F @ P @ F.T + np.diag(FULL.Q * dt)
        information = np.linalg.inv(P) + H.T @ np.diag(1.0 / FULL.R) @ H
        K = np.linalg.solve(information, H.T / FULL.R)
        x, error = x + K @ (record.y[k] - H @ x), (np.eye(2) - K @ H) @ error
        error[:, 2 + 2 * N + 2 * k : 4 + 2 * N + 2 * k] -= K * np.sqrt(FULL.R)
        xs.append(x)
        rows.append(L @ error)
        rest = information - L.T @ L / gamma**2
        if np.linalg.eigvalsh(rest)[0] <= 0.0:
            return None, np.inf
        P = np.linalg.inv(rest)
    return np.array(xs), float(np.linalg.norm(np.vstack(rows), 2))


def test_the_central_filter_keeps_its_bound() -> None:
    """It equals the textbook recursion; its worst ratio of energies is below gamma; below the least gamma there is no
    filter, and the Kalman filter's worst ratio is not below the least gamma.
    """
    record = Record(*(getattr(record_of(OSCILLATOR, gaps=False), name) for name in "tuy"), prior=FULL)
    L = np.array([[1.0, 0.3], [0.0, 2.0]])
    free = CentralHInfinity().estimate(OSCILLATOR, record, L=L)
    assert free.report is not None
    least = float(free.report["least gamma"])
    assert free.report["gamma"] == pytest.approx(1.5 * least)
    for gamma in (1.005 * least, 1.5 * least, 20.0 * least):
        found = CentralHInfinity().estimate(OSCILLATOR, record, gamma=gamma, L=L)
        expected, worst = central(record, gamma, L)
        assert found.status == "ok"
        assert expected is not None
        np.testing.assert_allclose(found.x, expected, rtol=0.0, atol=1e-8)
        assert worst < gamma
    assert central(record, 1e9, L)[1] > least * (1.0 - 2e-3)
    below = CentralHInfinity().estimate(OSCILLATOR, record, gamma=0.99 * least, L=L)
    assert central(record, 0.99 * least, L)[0] is None
    assert below.status == "no filter"
    assert "first fails at t = " in below.note
    assert np.all(np.isfinite(below.x))


def test_without_a_bound_it_is_the_kalman_filter() -> None:
    """For gamma -> infinity x and P are the EKF's to 1e-9, also nonlinear and with gaps; else P is larger."""
    record = record_of(PENDULUM)
    run = filtered(PENDULUM, record, PRIOR.x0, PRIOR.P0, PRIOR.Q, PRIOR.R)
    found = CentralHInfinity().estimate(PENDULUM, record, gamma=1e8)
    np.testing.assert_allclose(found.x, run.x, rtol=0.0, atol=1e-9)
    assert found.P is not None
    np.testing.assert_allclose(found.P, run.P, rtol=0.0, atol=1e-9)
    bold = CentralHInfinity().estimate(OSCILLATOR, record_of(OSCILLATOR))
    plain = CentralHInfinity().estimate(OSCILLATOR, record_of(OSCILLATOR), gamma=1e8)
    assert bold.P is not None
    assert plain.P is not None
    assert np.linalg.eigvalsh(bold.P - plain.P).min() > -1e-12
    assert np.trace(bold.P[-1]) > 1.01 * np.trace(plain.P[-1])


@pytest.mark.parametrize("horizon", [100, 4])
def test_moving_horizon_is_the_kalman_filter_on_a_linear_plant(horizon: int) -> None:
    """Whatever the horizon, as its arrival cost is then exact: states, d and covariances to 1e-6."""
    pytest.importorskip("casadi")
    record = record_of(OSCILLATOR, 25)
    grown, start = with_random_walk(OSCILLATOR, record, PRIOR, 1.0)
    run = filtered(grown, record, start.x0, start.P0, start.Q, start.R)
    found = MovingHorizon().estimate(OSCILLATOR, record, horizon=horizon)
    assert found.status == "ok", found.note
    assert found.d is not None
    assert found.P is not None
    np.testing.assert_allclose(found.x, run.x[:, :2], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.d[:, 1], run.x[:, 2], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.P, run.P[:, :2, :2], rtol=0.0, atol=1e-8)


def test_moving_horizon_finds_the_most_probable_path() -> None:
    """On the pendulum its end is that of scipy's least squares over the first state and all noise, to 1e-5."""
    pytest.importorskip("casadi")
    record = record_of(PENDULUM, 9, dt=0.3)
    grown, start = with_random_walk(PENDULUM, record, PRIOR, 1.0)
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
        return np.concatenate([z, np.nan_to_num(e / np.sqrt(PRIOR.R)).ravel()])

    best = path(least_squares(residuals, np.zeros(N + 2), xtol=1e-12, ftol=1e-12, gtol=1e-12).x)
    found = MovingHorizon().estimate(PENDULUM, record, horizon=N)
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


def test_without_casadi_the_plug_in_loads_and_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """`skip` names the extra and the plain package; nothing is imported."""
    monkeypatch.setitem(sys.modules, "casadi", None)
    said = str(MovingHorizon().skip(OSCILLATOR, record_of(OSCILLATOR)))
    assert "unmodelled[mhe]" in said
    assert "pip install casadi" in said
