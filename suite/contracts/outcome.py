"""How a check can end otherwise than well, and the one way to run a method."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.errors import InputError
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


class BrokenContractError(Exception):
    """A check that does not hold: what was expected and what came, in a sentence."""


class NotApplicableError(Exception):
    """A check that says nothing of this plug-in, and why."""


def demand(holds: bool, otherwise: str) -> None:
    """Raise BrokenContractError with the sentence where something does not hold."""
    if not holds:
        raise BrokenContractError(otherwise)


def estimated(estimator: Estimator, model: Model, record: Record, **tuned: Any) -> Estimate:
    """The estimate, as the benchmark would get it, with its shapes checked; a refusal is NotApplicableError."""
    reason = estimator.skip(model, record)
    if reason is not None:
        raise NotApplicableError(f"it skips this plant: {reason}")
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            estimate = estimator.estimate(model, record, **tuned)
    except InputError as error:
        raise NotApplicableError(f"it refuses this plant: {error}") from None
    shaped(estimate, len(record), len(model.states))
    return estimate


def shaped(estimate: Estimate, N: int, n: int) -> None:
    """x (N, n), d (N, n), P and P_d (N, n, n), all finite; a status with its sentence."""
    demand(isinstance(estimate, Estimate), f"estimate returned {type(estimate).__name__}, not an Estimate")
    wanted = {"x": (N, n), "P": (N, n, n), "d": (N, n), "P_d": (N, n, n)}
    for name, shape in wanted.items():
        value = getattr(estimate, name)
        if value is None and name != "x":
            continue
        if not isinstance(value, np.ndarray):
            raise BrokenContractError(f"{name} is {type(value).__name__}, not an array")
        demand(value.shape == shape, f"{name} has shape {value.shape}, expected {shape}")
        demand(bool(np.all(np.isfinite(value))), f"{name} holds {_first_bad(value)}; status was {estimate.status!r}")
    demand(
        estimate.status == "ok" or len(estimate.note.split()) > 2,
        f"the status is {estimate.status!r} and no note says in a sentence what went wrong",
    )
    demand(
        estimate.J is None or (len(estimate.J) == 2 and bool(np.all(np.isfinite(estimate.J)))),
        f"J is {estimate.J}, expected two finite numbers (data, model)",
    )


def _first_bad(value: Array) -> str:
    bad = np.argwhere(~np.isfinite(value))
    return f"{value[tuple(bad[0])]} at {tuple(bad[0].tolist())}" if len(bad) else "no number"


def how(estimate: Estimate) -> str:
    """How a run ended, for the line of a check; nothing where it ended well."""
    return "" if estimate.status == "ok" else f"ended {estimate.status}: {estimate.note}"
