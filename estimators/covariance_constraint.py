"""Estimators whose weight of the model error follows from the covariance constraint, (3) of Raol (2016)."""

from __future__ import annotations

from estimators._covariance_constraint import Constrained
from estimators.generalized_ie import GeneralizedIE, GeneralizedIEDiscrete
from estimators.minimum_model_error import MinimumModelError


class ConstrainedIE(Constrained):
    """Generalized IE, continuous time, tuned by the covariance constraint. Raol (2016), (3) with (47)-(55)."""

    name = "generalized-ie-constrained"
    tuning = {"ratio": (0.2, 1.5, "linear")}
    method = GeneralizedIE()


class ConstrainedIEDiscrete(Constrained):
    """Generalized IE, discrete time, tuned by the covariance constraint. Raol (2016), (3) with (63)-(74)."""

    name = "generalized-ie-discrete-constrained"
    tuning = {"ratio": (0.2, 1.5, "linear")}
    method = GeneralizedIEDiscrete()


class ConstrainedMinimumModelError(Constrained):
    """Minimum model error, tuned by the covariance constraint. Mook and Junkins (1988); Raol (2016), (3)."""

    name = "minimum-model-error-constrained"
    kind = "smoother"
    tuning = {"ratio": (0.2, 1.5, "linear")}
    method = MinimumModelError()
