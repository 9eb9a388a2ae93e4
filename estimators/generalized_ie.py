"""Generalized invariant embedding: the model error's weight alpha Q in the cost is free."""

from __future__ import annotations

from typing import Unpack

from estimators._invariant_embedding import ContinuousOptions, DiscreteOptions, continuous, discrete
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class GeneralizedIE(Estimator):
    """Generalized IE, continuous time. Raol (2016), (47)-(55); J of (35) with alpha > 0.

    The extended Kalman-Bucy filter with P = 2S and process-noise density (alpha Q)^-1; dhat is its gain times the
    innovation, a rate, not the minimiser of J. Q (weight of J, (n,) or (n, n)), R (outputs,) (spectral density) and S0
    (n, n) override the prior's: density 1/(q_scale Q), R_sample dt (with the error of z between samples), P0/2.
    `riccati`: by "transition" matrix or by "integration". A channel counts over a step only
    if it was measured at both of its ends.
    """

    name = "generalized-ie"
    tuning = {"alpha": (1e-4, 1e6, "log")}

    def estimate(
        self,
        model: Model,
        record: Record,
        alpha: float = 1.0,
        q_scale: float = 1.0,
        **options: Unpack[ContinuousOptions],
    ) -> Estimate:
        return continuous(model, record, alpha, q_scale, **options)


class GeneralizedIEDiscrete(Estimator):
    """Generalized IE, discrete time. Raol (2016), (63)-(74).

    The extended Kalman filter with P = 2S and process noise (alpha Q)^-1 dt a step, the first sample included. dhat is
    the jump of a sample, 2 S H' R^-1 (z - h), made a rate by the integral of e^(F s) over the step that ends there.
    `residual` "after" takes the residual after the update, as (95) is printed: then dhat fades as alpha Q does.
    Q as in the continuous filter, R (outputs,) the variance of a sample, S0 (n, n) override the prior's.
    """

    name = "generalized-ie-discrete"
    tuning = {"alpha": (1e-4, 1e6, "log")}
    optimal = "white noise"

    def estimate(
        self, model: Model, record: Record, alpha: float = 1.0, q_scale: float = 1.0, **options: Unpack[DiscreteOptions]
    ) -> Estimate:
        return discrete(model, record, alpha, q_scale, **options)
