"""The contract of an estimator: model and one run of measurements in, states and model error out."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Range = tuple[float, float, Literal["log", "linear"]]


@dataclass(frozen=True)
class Estimate:
    """What an estimator says of one run.

    x (steps, n); P (steps, n, n) its covariance or None; d (steps, n) the model error in rate units, so that the
    plant's rate is f + d, or None; P_d (steps, n, n) its covariance or None; J the cost's two parts (data, model) or
    None; parameters what it says of parameters, by name; status "ok", or in a word what went wrong, and the note in
    a sentence; report: numbers of its own that belong in its row (a threshold, an interval), by name; examine: gives
    more of them, where they take longer to find than the estimate; whoever judges calls it when the clock has stopped.
    """

    x: Array
    P: Array | None = None
    d: Array | None = None
    P_d: Array | None = None
    J: tuple[float, float] | None = None
    parameters: Mapping[str, float] | None = None
    status: str = "ok"
    note: str = ""
    report: Mapping[str, float | str] | None = None
    examine: Callable[[], Mapping[str, float | str]] | None = field(default=None, compare=False)


class Estimator(abc.ABC):
    """A method. A subclass sets `name` and `tuning` and writes `estimate`; its docstring names author and equation.

    `tuning` says what the equal-budget tuner may move: keyword arguments of `estimate`, each as (low, high, scale).
    `kind` is "filter" (causal) or "smoother". `record` has one run and a `prior`; R there is the variance of a sample.

    `optimal` is a claim that `unmodelled test` holds it to: the model error for which, on a linear plant with Gaussian
    noise, x and P are those of the Kalman filter (of the fixed-interval smoother, if it is one) and P is calibrated:
    "white noise" of the prior's density Q, a "random walk" or "integrated walk" as `with_random_walk` and
    `with_integrated_walk` make them, or None, no such claim.
    `optimal_within`: how closely, in posterior standard deviations (an ensemble comes near only).
    """

    name: ClassVar[str]
    kind: ClassVar[Literal["filter", "smoother"]] = "filter"
    tuning: ClassVar[Mapping[str, Range]] = {}
    optimal: ClassVar[Literal["white noise", "random walk", "integrated walk"] | None] = None
    optimal_within: ClassVar[float] = 1e-3

    @abc.abstractmethod
    def estimate(self, model: Model, record: Record, *args: Any, **kwargs: Any) -> Estimate:
        """Estimate states and model error; inputs are not changed, the same call gives the same result.

        A subclass has the keywords that its `tuning` names, each with a default.
        """

    def skip(self, model: Model, record: Record) -> str | None:
        """Why this method does not apply here, or None."""
        return None
