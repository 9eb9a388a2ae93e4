"""Minimum model error: the d(t) that minimises J over the whole record."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from estimators._invariant_embedding import cost, density
from suite.estimator import Estimate, Estimator
from suite.filtering import filtered, held
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record
from suite.smoothing import smoothed

Array = npt.NDArray[np.float64]

CONVERGED = 1e-8
ROUNDS = 50
# Full Gauss-Newton steps so long; a path that still swings is then followed by half steps.
FULL = 15


class MinimumModelError(Estimator):
    """Minimum model error, solved as an iterated fixed-interval smoother. Mook and Junkins (1988); Bell (1994).

    d = (1/(2 alpha)) Q^-1 lambda minimises J, found by Gauss-Newton: smooth, linearise around the smoothed path,
    until it stands. At a sample d is the mean of lambda's values ahead of and behind the measurement (it ends at
    zero: lambda(tf) = 0). P_d is the covariance of d's mean over the step that ends at the sample (at the first, over
    the first step), d taken as white noise of density (alpha Q)^-1. `Q` (weight of J, (n,) or (n, n)) overrides the
    prior's, density 1/(q_scale Q).
    """

    name = "minimum-model-error"
    kind = "smoother"
    tuning = {"alpha": (1e-4, 1e6, "log")}
    optimal = "white noise"

    def estimate(
        self, model: Model, record: Record, alpha: float = 1.0, q_scale: float = 1.0, Q: Array | None = None
    ) -> Estimate:
        prior = prior_of(record)
        inverse = density(prior, q_scale, Q)
        noise = inverse / alpha
        # The noise acts half at the start of a step, half at its end (`spread`); the model runs between the two.
        half = np.concatenate([0.5 * record.dt, [0.0]])[:, None]
        status, note, rounds = "ok", "", 0
        run = filtered(model, record, prior.x0, prior.P0, noise, prior.R, spread=True)
        if run.failed_at is not None:
            x = held(run.x, run.failed_at)
            return Estimate(x=x, d=np.zeros_like(x), status="diverged", note=run.failure(record.t))
        result, Phi = smoothed(run), run.Phi
        path, kick = result.x, result.after @ noise
        for rounds in range(1, ROUNDS + 1):
            share = 1.0 if rounds <= FULL else 0.5
            path = path + share * (result.x - path)
            kick = kick + share * (result.after @ noise - kick)
            around = (path, path + half * kick)
            run = filtered(model, record, prior.x0, prior.P0, noise, prior.R, spread=True, around=around)
            trial = smoothed(run) if run.failed_at is None else None
            if trial is None or not np.all(np.isfinite(trial.x)):
                status, note = "diverged", f"Gauss-Newton left every bound in round {rounds}; the round before is given"
                break
            change = float(np.max(np.abs(trial.x - path) / (np.max(np.abs(path), axis=0) + 1e-300)))
            result, Phi = trial, run.Phi
            if change < CONVERGED:
                break
        else:
            status, note = "not converged", f"the path still changed by {change:.1e} of its size after {ROUNDS} rounds"
        d = 0.5 * (result.before + result.after) @ noise
        steps = np.concatenate([record.dt[:1], record.dt])
        # The mean over a step is (kick at its start + kick at its end) / dt; the first reaches its end through Phi.
        both = (np.eye(len(noise)) + Phi) @ noise
        P_d = noise / steps[:, None, None] - 0.25 * both.transpose(0, 2, 1) @ result.Before @ both
        P_d[0] = P_d[1]
        J = cost(model, record, result.x, d, inverse, alpha, prior.R * steps[:, None])
        return Estimate(
            x=result.x, P=result.P, d=d, P_d=P_d, J=J, status=status, note=note, report={"rounds": float(rounds)}
        )
