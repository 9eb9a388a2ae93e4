"""What every estimator must hold, whatever its method."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial

import numpy as np

from suite.contracts import optimality, plants
from suite.contracts.outcome import BrokenContractError, NotApplicableError, demand, estimated, how
from suite.errors import InputError
from suite.estimator import Estimate, Estimator
from suite.model import Model
from suite.record import Record

FAR = 5.0  # a constant model error is found within this factor


def identity(estimator: Estimator) -> str:
    """A docstring says what the method is; kind is one of the two."""
    demand(bool((type(estimator).__doc__ or "").strip()), "no docstring; write a sentence with author and year")
    demand(estimator.kind in ("filter", "smoother"), f"kind is {estimator.kind!r}, expected 'filter' or 'smoother'")
    return estimator.kind


def shapes(estimator: Estimator) -> str:
    """Shapes, finite numbers and status, on a driven plant whose model lacks a cubic spring."""
    return how(_two_states(estimator, lambda record, _: record))


def unchanged(estimator: Estimator) -> str:
    """The record, its prior and the model are after the call as they were before."""
    record = plants.record(plants.LINEAR, plants.HARDENING)
    prior = record.prior
    assert prior is not None
    arrays = {"t": record.t, "u": record.u, "y": record.y, "x0": prior.x0, "P0": prior.P0, "R": prior.R, "Q": prior.Q}
    before = {name: array.copy() for name, array in arrays.items()}
    model, values = repr(plants.LINEAR), plants.LINEAR.values
    estimated(estimator, plants.LINEAR, record)
    for name, array in arrays.items():
        demand(np.array_equal(array, before[name], equal_nan=True), f"estimate changed {name} in place; copy it first")
    same = repr(plants.LINEAR) == model and np.array_equal(plants.LINEAR.values, values)
    demand(same, "estimate changed the model")
    return ""


def repeats(estimator: Estimator) -> str:
    """The same call gives the same numbers."""
    record = plants.record(plants.LINEAR, plants.HARDENING)
    one, other = (estimated(estimator, plants.LINEAR, record) for _ in range(2))
    for name in ("x", "P", "d", "P_d"):
        a, b = getattr(one, name), getattr(other, name)
        same = (a is None and b is None) or (a is not None and b is not None and np.array_equal(a, b))
        demand(same, f"{name} differs between two equal calls; seed the random numbers inside estimate")
    demand((one.J, one.status) == (other.J, other.status), "J or status differs between two equal calls")
    return ""


def missing_samples(estimator: Estimator) -> str:
    """A third of the samples missing, the last among them."""
    return _as_well_as_whole(estimator, plants.without_samples)


def missing_channels(estimator: Estimator) -> str:
    """Each channel with gaps of its own, no sample complete but a few."""
    return _as_well_as_whole(estimator, plants.by_channel)


def irregular_steps(estimator: Estimator) -> str:
    """Steps of unequal length."""
    return _as_well_as_whole(estimator, plants.irregular)


def short_records(estimator: Estimator) -> str:
    """Two and three samples."""
    ends = [how(_two_states(estimator, partial(plants.short, samples=count))) for count in (2, 3)]
    return next((end for end in ends if end), "")


def one_state(estimator: Estimator) -> str:
    """A plant with one state and no input."""
    return how(estimated(estimator, plants.DECAY, plants.record(plants.DECAY, plants.FASTER)))


def unmeasured_state(estimator: Estimator) -> str:
    """A plant of which only the position is measured."""
    truth = plants.POSITION.plus("v", "-a*p**3", {"a": plants.HARDENING.parameters["a"]})
    return how(estimated(estimator, plants.POSITION, plants.record(plants.POSITION, truth)))


def refusal(estimator: Estimator) -> str:
    """What it does not do it refuses with a reason; it does something; without a prior it says so or needs none."""
    reasons: list[str | None] = []
    for model, truth in ((plants.LINEAR, plants.HARDENING), (plants.DECAY, plants.FASTER)):
        record = plants.record(model, truth)
        for changed in (record, plants.short(record, model, 2), plants.irregular(record, model)):
            reason = estimator.skip(model, changed)
            said = reason is None or (isinstance(reason, str) and len(reason.split()) > 1)
            demand(said, f"skip returned {reason!r}, expected None or a reason in words")
            reasons.append(reason)
    demand(None in reasons, f"it refuses every plant of the contract: {reasons[0]}")
    bare = plants.record(plants.LINEAR, plants.HARDENING)
    try:
        estimator.estimate(plants.LINEAR, Record(bare.t, bare.u, bare.y))
    except InputError as error:
        return f"without a prior: {error}"
    except Exception as error:
        raise BrokenContractError(
            f"without a prior it fails with {type(error).__name__}: {error}; call prior_of(record), which says it"
        ) from None
    return "needs no prior" if not any(reasons) else f"skips: {next(reason for reason in reasons if reason)}"


def tuning(estimator: Estimator) -> str:
    """Each tuned name is a keyword with a default, its range is one, and both of its ends give an estimate."""
    if not estimator.tuning:
        raise NotApplicableError("it has nothing to tune")
    accepted = inspect.signature(estimator.estimate).parameters
    record = plants.record(plants.LINEAR, plants.HARDENING).part(0, 40)
    for name, entry in estimator.tuning.items():
        demand(len(entry) == 3, f"tuning {name!r} is {entry!r}, expected (low, high, 'log' or 'linear')")
        low, high, scale = entry
        demand(scale in ("log", "linear"), f"tuning {name!r}: scale {scale!r}, expected 'log' or 'linear'")
        demand(
            low < high and (scale == "linear" or low > 0), f"tuning {name!r}: {low:g} to {high:g} is no {scale} range"
        )
        demand(
            name in accepted and accepted[name].default is not inspect.Parameter.empty,
            f"tuning {name!r} is no keyword of estimate with a default",
        )
        for value in (low, high):
            estimated(estimator, plants.LINEAR, record, **{name: value})
    return ", ".join(estimator.tuning)


def rate_units(estimator: Estimator) -> str:
    """A constant model error is found in rate units: its mean over the second half is right within a factor of five."""
    record = plants.record(plants.LINEAR, plants.PUSHED, seconds=30.0)
    found = estimated(estimator, plants.LINEAR, record)
    if found.d is None:
        raise NotApplicableError("it returns no d")
    if found.status != "ok":
        raise NotApplicableError(f"it {how(found)}")
    mean = float(np.mean(found.d[len(record) // 2 : -1, 1]))
    said = f"{mean:.2f} found where {plants.CONSTANT} is missing from the rate, step {float(record.dt[0]):g}"
    demand(plants.CONSTANT / FAR < mean < plants.CONSTANT * FAR, f"d is not in rate units, or finds nothing: {said}")
    return said


def covariance(estimator: Estimator) -> str:
    """P and P_d are symmetric without negative eigenvalues, on complete records and those with gaps."""
    checked = set()
    for change in (lambda record, _: record, plants.by_channel, plants.irregular):
        found = _two_states(estimator, change)
        if found.status != "ok":
            raise NotApplicableError(f"it {how(found)}")
        for name in ("P", "P_d"):
            P = getattr(found, name)
            if P is None:
                continue
            checked.add(name)
            size = float(np.max(np.abs(P))) or 1.0
            demand(float(np.max(np.abs(P - P.transpose(0, 2, 1)))) <= 1e-9 * size, f"{name} is not symmetric")
            least = float(np.linalg.eigvalsh(P).min())
            demand(least >= -1e-9 * size, f"{name} has the eigenvalue {least:.2g}")
    if not checked:
        raise NotApplicableError("it returns no covariance")
    return ", ".join(sorted(checked))


def _two_states(estimator: Estimator, change: Callable[[Record, Model], Record]) -> Estimate:
    record = plants.record(plants.LINEAR, plants.HARDENING)
    return estimated(estimator, plants.LINEAR, change(record, plants.LINEAR))


def _as_well_as_whole(estimator: Estimator, change: Callable[[Record, Model], Record]) -> str:
    """How a run on a changed record ended; one that breaks where the whole record does no harm is no honest failure."""
    whole, found = _two_states(estimator, lambda record, _: record), _two_states(estimator, change)
    demand(found.status == "ok" or whole.status != "ok", f"the whole record does no harm, but this one {how(found)}")
    return how(found)


CHECKS: dict[str, Callable[[Estimator], str]] = {
    "docstring and kind": identity,
    "shapes and finite values": shapes,
    "inputs unchanged": unchanged,
    "same result twice": repeats,
    "missing samples": missing_samples,
    "gaps by channel": missing_channels,
    "irregular steps": irregular_steps,
    "two and three samples": short_records,
    "one state": one_state,
    "unmeasured state": unmeasured_state,
    "refusal with a reason": refusal,
    "tuning": tuning,
    "d in rate units": rate_units,
    "covariance": covariance,
    "linear-Gaussian agreement": optimality.linear_gaussian,
    "covariance calibrated": optimality.calibrated,
}
