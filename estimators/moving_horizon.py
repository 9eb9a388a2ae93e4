"""Moving-horizon estimation with a disturbance: the best path through the last samples, anew at each sample."""

from __future__ import annotations

import importlib.util

import numpy as np

from estimators._moving_horizon import solve_window, substeps_of, window
from suite.disturbance import spread_out, with_random_walk
from suite.estimator import Estimate, Estimator
from suite.filtering import filtered, held
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record


class MovingHorizon(Estimator):
    """Moving-horizon estimation with a random-walk disturbance, by CasADi and IPOPT. Rao, Rawlings and Mayne (2003).

    At each sample the path through the last `horizon` steps minimises arrival cost + noise + residuals (multiple
    shooting, RK4); the arrival cost is an extended Kalman filter's, linearised along the paths found before. x, P, d
    and P_d are those of the newest sample. `q_scale` multiplies the density of the walk (see `with_random_walk`).
    Slow: some milliseconds a sample and more, against microseconds of the filters.
    """

    name = "moving-horizon"
    tuning = {"q_scale": (1e-4, 1e4, "log")}

    def skip(self, model: Model, record: Record) -> str | None:
        if importlib.util.find_spec("casadi") is None:
            return "CasADi is not installed; get it with: pip install 'unmodelled[mhe]' (or pip install casadi)"
        return None

    def estimate(self, model: Model, record: Record, q_scale: float = 1.0, horizon: int = 20) -> Estimate:
        n, N = len(model.states), len(record)
        grown, start = with_random_walk(model, record, prior_of(record), q_scale)
        ekf = filtered(grown, record, start.x0, start.P0, start.Q, start.R)
        x, P = np.zeros_like(ekf.x), np.zeros_like(ekf.P)
        # One sample is no window: there the filter's update is the answer.
        x[0], P[0] = ekf.x[0], ekf.P[0]
        made = window(grown, start, min(horizon, N - 1), substeps_of(grown, record, held(ekf.x, ekf.failed_at)))
        mean, covariance = start.x0, start.P0
        path, noise, unsolved, failed_at = x[:1], np.zeros((0, len(made.noisy))), 0, None
        for k in range(1, N):
            part = record.part(max(0, k - made.steps), k + 1)
            moved = grown.step(part.t[-2], path[-1], part.u[-2], part.dt[-1], part.u[-1])
            path = np.vstack([path, moved])[-len(part) :]
            noise = np.vstack([noise, np.zeros((1, len(made.noisy)))])[1 - len(part) :]
            path, noise, solved = solve_window(made, part, mean, covariance, path, noise)
            unsolved += not solved
            # The filter along the path found has the covariance at its end, and the next window's arrival cost.
            run = filtered(grown, part, mean, covariance, start.Q, start.R, around=(path, path))
            if run.failed_at is not None or not np.all(np.isfinite(path)):
                failed_at = k
                break
            x[k], P[k] = path[-1], run.P[-1]
            if k >= made.steps:
                mean, covariance = run.x_prior[1], run.P_prior[1]
        x, P = held(x, failed_at), held(P, failed_at)
        d, P_d = spread_out(model, x, P)
        status, note = "ok", ""
        if failed_at is not None:
            when = f"t = {record.t[failed_at]:.4g} s; the last estimate is held from there"
            status, note = "diverged", f"the path through the window left every bound at {when}"
        elif unsolved:
            status, note = "not converged", f"IPOPT did not converge in {unsolved} of {N - 1} windows"
        report = {"horizon": float(made.steps), "windows not converged": float(unsolved)}
        return Estimate(x=x[:, :n], P=P[:, :n, :n], d=d, P_d=P_d, status=status, note=note, report=report)
