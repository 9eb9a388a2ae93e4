"""Conventional invariant embedding: alpha = 1, the weight Q alone says how large the model error may be."""

from __future__ import annotations

from typing import Unpack

from estimators._invariant_embedding import ContinuousOptions, DiscreteOptions, continuous, discrete
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record


class ConventionalIE(Estimator):
    """Conventional IE, continuous time. Detchmendy and Sridhar (1966); Raol (2016), (47)-(55) with alpha = 1.

    As `generalized-ie`, which it equals with alpha Q for Q: J(alpha, Q) = J(1, alpha Q). `q_scale` multiplies the
    weight Q; Q, R (spectral density) and S0 override the prior's.
    """

    name = "conventional-ie"
    tuning = {"q_scale": (1e-4, 1e6, "log")}

    def estimate(
        self, model: Model, record: Record, q_scale: float = 1.0, **options: Unpack[ContinuousOptions]
    ) -> Estimate:
        return continuous(model, record, 1.0, q_scale, **options)


class ConventionalIEDiscrete(Estimator):
    """Conventional IE, discrete time. Raol (2016), (63)-(74) with alpha = 1; arguments as `generalized-ie-discrete`."""

    name = "conventional-ie-discrete"
    tuning = {"q_scale": (1e-4, 1e6, "log")}
    optimal = "white noise"

    def estimate(
        self, model: Model, record: Record, q_scale: float = 1.0, **options: Unpack[DiscreteOptions]
    ) -> Estimate:
        return discrete(model, record, 1.0, q_scale, **options)
