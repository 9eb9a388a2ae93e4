"""The covariance constraint: the weight of the model error at which the residuals are as large as the noise."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np

from estimators.generalized_ie import GeneralizedIE, GeneralizedIEDiscrete
from estimators.minimum_model_error import MinimumModelError
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.prior import prior_of
from suite.record import Record

LEAST, MOST = 1e-6, 1e10  # alpha; beyond MOST nothing is left of d
ROUNDS = 12


def residual_ratio(model: Model, record: Record, found: Estimate) -> float:
    """Mean of e^2 / R over all readings, e = z - h(xhat) after the update: 1 where the constraint holds."""
    h = np.array([model.output(t, x, u) for t, x, u in zip(record.t, found.x, record.u, strict=True)])
    with np.errstate(all="ignore"):
        e = record.y - h
        e = np.where(model.angles > 0, np.arctan2(np.sin(e), np.cos(e)), e)
        ratio = float(np.nanmean(e**2 / prior_of(record).R))
    return ratio if found.status == "ok" and math.isfinite(ratio) else math.inf


class Constrained(Estimator):
    """Mook and Junkins (1988); Raol (2016), (3): choose alpha so that the covariance of the residuals is R.

    The residuals grow with alpha, the weight of d, so its logarithm is found by bisection. `ratio` asks for another
    multiple of R. Where the model is right the residuals stay below R at any weight: the largest is taken then. The
    report has alpha and the ratio that was reached.
    """

    method: ClassVar[GeneralizedIE | GeneralizedIEDiscrete | MinimumModelError]

    def estimate(self, model: Model, record: Record, ratio: float = 1.0, q_scale: float = 1.0) -> Estimate:
        low, high = math.log(LEAST), math.log(MOST)

        def at(level: float) -> tuple[Estimate, float]:
            found = self.method.estimate(model, record, alpha=math.exp(level), q_scale=q_scale)
            return found, residual_ratio(model, record, found)

        best, reached = at(low)
        level = low
        # The residuals at the least weight exceed what is asked only where the method does not work at all.
        for _ in range(ROUNDS if reached < ratio else 0):
            middle = 0.5 * (low + high)
            found, got = at(middle)
            if got <= ratio:
                best, reached, level, low = found, got, middle, middle
            else:
                high = middle
        final = f"alpha = {math.exp(level):.4g}, residuals {reached:.3g} times R"
        report = {**(best.report or {}), "alpha": math.exp(level)}
        if math.isfinite(reached):
            report["residual covariance over R"] = reached
        return replace(best, report=report, note=f"{best.note}; {final}" if best.note else final)
