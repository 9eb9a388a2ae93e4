"""Reference rows: what is possible with the true model, and what the sensors alone give.

They are no estimators. They stand on the judge's side and are handed what an estimator never gets: the true model of
the case and, for the bound, the true trajectory. Their rows have kind "reference" and are of variant "reference".
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from suite import plugins
from suite.benchmark import metrics
from suite.case import Case, Truth
from suite.estimator import Estimate, Estimator, Range
from suite.filtering import filtered, held
from suite.model import Model
from suite.prior import prior_of
from suite.readings import read_by, readings
from suite.record import Record
from suite.smoothing import smoothed

Array = npt.NDArray[np.float64]

VARIANT = "reference"

# Shares of the prior's process noise among which the oracle takes the likeliest: a perfect model with none at all
# stops listening to its sensors, which on a chaotic plant loses the path.
SHARES = (1e-6, 1e-4, 1e-2, 1.0)
# A sensor that reads a state directly gave the prior its first value: that counts once, not twice, in the bound.
UNKNOWN = 1e6


class Reference(abc.ABC):
    """A row to compare with. It has an estimator's name, kind and (empty) tuning, and judges itself."""

    name: ClassVar[str]
    sentence: ClassVar[str]
    kind: ClassVar[Literal["filter", "smoother"]] = "filter"
    tuning: ClassVar[Mapping[str, Range]] = {}

    @abc.abstractmethod
    def row(self, case: Case, record: Record, truth: Truth) -> dict[str, Any]:
        """The numbers of its row, or its status with the reason."""


class Oracle(Reference):
    """Extended Kalman filter with the plant's own equations and parameters; its process noise by likelihood."""

    name = "oracle"
    sentence = "Extended Kalman filter with the true model: what a filter reaches when nothing is missing."

    def row(self, case: Case, record: Record, truth: Truth) -> dict[str, Any]:
        model, kept = _plant(case), case.shared
        x0, P0, Q = _start(case, record)
        runs = [filtered(model, record, x0, P0, share * Q, prior_of(record).R) for share in SHARES]
        run = max(runs, key=lambda run: run.log_likelihood if run.failed_at is None else -np.inf)
        x, P = held(run.x, run.failed_at), held(run.P, run.failed_at)
        if self.kind == "smoother" and run.failed_at is None:
            after = smoothed(run)
            x, P = after.x, after.P
        pairs = zip(record.t, x, record.u, strict=True)
        d = np.array([model.rate(t, s, u)[kept] - case.deficient.rate(t, s[kept], u) for t, s, u in pairs])
        status, note = ("ok", "") if run.failed_at is None else ("diverged", "the filter of the true model diverged")
        estimate = Estimate(x=x[:, kept], P=P[:, kept[:, None], kept], d=d, status=status, note=note)
        row = metrics.judge(case, record, truth, estimate, self.kind)
        # It was told the coefficients, and the deficient model's sensors may not be those that it reads.
        given = {"parameters", "parameter_error", "parameter_worst", "named", "named_as"}
        given |= {"nis"} if model.outputs != case.deficient.outputs else set()
        return {key: value for key, value in row.items() if key not in given}


class OracleSmoother(Oracle):
    """The oracle with the readings of the whole record."""

    name = "oracle-smoother"
    sentence = "Extended Kalman smoother with the true model: what a smoother reaches when nothing is missing."
    kind = "smoother"


class PosteriorBound(Reference):
    """Posterior Cramer-Rao bound of the states given the readings up to each sample.

    Tichavsky, Muravchik and Nehorai (1998): J(k+1) = D22 - D21 (J(k) + D11)^-1 D12 along the true trajectory. The
    plant has no process noise; in this limit, and with Gaussian readings, the recursion is the Riccati equation of
    the extended Kalman filter linearised at the truth, P = J^-1, which also holds for states that are known (P = 0). It
    averages over the first state's prior, that of the estimators; a guess better than its P0 says may beat it.
    """

    name = "posterior-crb"
    sentence = "Posterior Cramer-Rao bound of a filter with the true model: the smallest RMSE to be expected."

    def row(self, case: Case, record: Record, truth: Truth) -> dict[str, Any]:
        if not np.all(truth.noise > 0):
            return {"status": "skipped", "reason": "a sensor has no noise, so the bound is zero"}
        model, kept = _plant(case), case.shared
        x0, P0, Q = _start(case, record)
        outputs, read = list(model.outputs), read_by(model)
        for i, name in enumerate(model.states):
            if name in read and P0[i, i] > 0 and not np.isnan(record.y[0, outputs.index(read[name])]):
                P0[i, i] *= UNKNOWN
        path, _, _ = case.run(record.t, record.u)
        run = filtered(model, record, x0, P0, 0.0 * Q, truth.noise**2, around=(path, path))
        if run.failed_at is not None:
            return {"status": "error", "reason": f"the bound is not finite from t = {record.t[run.failed_at]:.4g} s on"}
        P = run.P if self.kind == "filter" else smoothed(run).P
        variance = np.maximum(np.einsum("kii->ki", P)[:, kept], 0.0).mean(axis=0)
        if not np.any(variance > 0):
            return {"status": "skipped", "reason": "the first state is known, so the true model gives it without error"}
        scale = np.maximum(truth.x.std(axis=0), 1e-300)
        rmse = dict(zip(case.deficient.states, np.sqrt(variance).tolist(), strict=True))
        return {"state_rmse": rmse, "state_nrmse": float(np.sqrt(np.mean(variance / scale**2)))}


class SmootherBound(PosteriorBound):
    """The same bound given the readings of the whole record, by the smoother's covariance along the truth."""

    name = "posterior-crb-smoother"
    sentence = "Posterior Cramer-Rao bound of a smoother with the true model: the smallest RMSE to be expected."
    kind = "smoother"


class Sensors(Reference):
    """The reading itself for each state; the last one is held where a sensor was not read."""

    name = "trust-the-sensor"
    sentence = "The last reading as the estimate of the state: what no model at all gives."

    def row(self, case: Case, record: Record, truth: Truth) -> dict[str, Any]:
        read = readings(case.deficient, record)
        missing = [name for name in case.deficient.states if name not in read]
        if missing:
            return {"status": "skipped", "reason": f"no sensor reads {', '.join(missing)} alone"}
        x = np.column_stack([_filled(read[name]) for name in case.deficient.states])
        return metrics.judge(case, record, truth, Estimate(x=x), self.kind)


REFERENCES: dict[str, Reference] = {
    entry.name: entry for entry in (Oracle(), OracleSmoother(), PosteriorBound(), SmootherBound(), Sensors())
}


def methods() -> dict[str, Estimator | Reference]:
    """Everything that has rows in the matrix: estimators, baselines and references, by name."""
    return {**plugins.estimators(), **REFERENCES}


def row(name: str, case: Case, record: Record, truth: Truth | None) -> dict[str, Any]:
    """The row of a reference; a measured case has no truth to refer to."""
    if truth is None:
        return {"kind": "reference", "status": "skipped", "reason": "a measured case has no truth to refer to"}
    return {"kind": "reference", **REFERENCES[name].row(case, record, truth)}


def _plant(case: Case) -> Model:
    assert case.truth is not None
    return case.truth


def _start(case: Case, record: Record) -> tuple[Array, Array, Array]:
    """The prior of the true model's states: x0, P0 and Q as the estimators have them, its own states known and sure."""
    model, prior, kept = _plant(case), prior_of(record), case.shared
    assert case.experiment is not None
    n = len(model.states)
    x0, P0, Q = np.array(case.experiment.x0, dtype=np.float64), np.zeros((n, n)), np.zeros(n)
    x0[kept], P0[kept[:, None], kept], Q[kept] = prior.x0, prior.P0, prior.Q
    return x0, P0, Q


def _filled(values: Array) -> Array:
    """The last reading where there is none; before the first, the first."""
    at = np.maximum.accumulate(np.where(np.isnan(values), -1, np.arange(len(values))))
    return np.where(at < 0, values[np.argmax(~np.isnan(values))], values[at])
