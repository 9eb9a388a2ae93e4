"""The judge: what an estimate is worth against the truth that the estimator never saw. No sample is left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from suite import along, plugins
from suite.benchmark.innovations import whitened
from suite.case import Case, Truth
from suite.estimator import Estimate
from suite.metric import Judged
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

# The simple shapes an effect may have in one state; the best correlated with d gives the effect its name.
SHAPES: dict[str, Callable[[Array], Array]] = {
    "{}": lambda s: s,
    "{0}*|{0}|": lambda s: s * np.abs(s),
    "{}^3": lambda s: s**3,
    "sign({})": np.sign,
}

# An eigenvalue of a correlation below this share of the largest one is rounding: a smoother's P - P Lambda P may have
# lost six digits of it.
EXACT = 1e-9


def judge(
    case: Case, record: Record, truth: Truth | None, estimate: Estimate, kind: Literal["filter", "smoother"]
) -> dict[str, Any]:
    """The numbers of a row; those that do not apply are left out."""
    row: dict[str, Any] = {"report": {**(estimate.report or {}), **(estimate.examine() if estimate.examine else {})}}
    if estimate.status != "ok":
        row |= {"status": "diverged", "reason": f"{estimate.status}: {estimate.note}".rstrip(": ")}
    if not np.all(np.isfinite(estimate.x)):
        first = int(np.argmax(~np.isfinite(estimate.x).all(axis=1)))
        said = row.get("reason") or f"the state is not finite from t = {record.t[first]:g} on"
        return {**row, "status": "diverged", "reason": said}
    model = case.deficient
    row["output_rmse"] = _output_rmse(model, record, estimate)
    if estimate.J is not None:
        row |= {"J": sum(estimate.J), "J_data": estimate.J[0], "J_model": estimate.J[1]}
    if kind == "filter" and estimate.P is not None:
        row["nis"] = nis(model, record, estimate)
    row |= measured(Judged(case, record, truth, estimate, kind), row)
    if truth is None:
        return row
    error = np.sqrt(np.mean((estimate.x - truth.x) ** 2, axis=0))
    scale = np.maximum(truth.x.std(axis=0), 1e-300)
    row["state_rmse"] = dict(zip(model.states, error.tolist(), strict=True))
    row["state_nrmse"] = float(np.sqrt(np.mean((error / scale) ** 2)))
    if estimate.P is not None:
        row["nees"] = nees(estimate.x - truth.x, estimate.P)
    if estimate.d is None or not np.all(np.isfinite(estimate.d)):
        return row
    inside = [i for i, name in enumerate(model.states) if name in model.suspects]
    gap = np.sqrt(np.mean((estimate.d - truth.d)[:, inside] ** 2))
    size = np.sqrt(np.mean(truth.d[:, inside] ** 2))
    row["d_rmse"] = float(gap)
    if size > 0.0:
        row["d_nrmse"] = float(gap / size)
    return {**row, **coefficients(case, record, estimate), **named(case, truth, estimate)}


# What a row says of itself; a metric of that name would overwrite it.
TAKEN = {
    "case", "noise", "estimator", "variant", "seed", "key", "status", "reason", "kind", "tuning", "seconds",
    "step_us", "steps", "peak_mb", "output_rmse", "report", "metric_errors", "J", "J_data", "J_model", "nis",
    "nees", "state_rmse", "state_nrmse", "d_rmse", "d_nrmse", "parameters", "parameter_error", "parameter_worst",
    "named", "named_as", "plugin_hash", "case_hash", "versions", "when",
}  # fmt: skip


def measured(judged: Judged, row: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of the metrics that are plug-ins; what one raises goes to `metric_errors` under its name."""
    found: dict[str, Any] = {}
    errors: dict[str, str] = {}
    for name, metric in plugins.metrics().items():
        try:
            if name in TAKEN or name in row:
                raise ValueError(f"the name {name!r} is a field of the row already; choose another")
            value = metric.value(judged)
            if value is not None:
                found[name] = float(value)
        except Exception as error:  # a plug-in may fail in any way; the row keeps its other numbers
            errors[name] = f"{type(error).__name__}: {error}"
    return found | ({"metric_errors": errors} if errors else {})


def coefficients(case: Case, record: Record, estimate: Estimate) -> dict[str, Any]:
    """The missing coefficients by least squares of d on their terms at the estimated states, as the sources do it.

    The terms are the derivatives of the true rates by the coefficients; `parameter_error` is relative.
    """
    if not _in_rates(case) or case.truth is None or estimate.d is None:
        return {}
    columns = list(case.truth.parameters)
    found: dict[str, float] = {}
    errors: dict[str, float] = {}
    for equation in dict.fromkeys(missing.equation for missing in case.missing):
        i = list(case.deficient.states).index(equation)
        truths = {n: v for m in case.missing if m.equation == equation for n, v in m.coefficients.items()}
        wanted = [columns.index(name) for name in truths]
        terms = along.rate_slopes(case.truth, record, estimate.x, i, wanted)
        fitted = np.linalg.lstsq(terms, estimate.d[:, i], rcond=None)[0]
        found |= dict(zip(truths, fitted.tolist(), strict=True))
        errors |= {name: abs(found[name] - true) / abs(true) for name, true in truths.items()}
    return {"parameters": found, "parameter_error": errors, "parameter_worst": max(errors.values())}


def named(case: Case, truth: Truth, estimate: Estimate) -> dict[str, Any]:
    """Which shape of SHAPES in which state goes best with d (largest |cosine|), and whether it is the true one.

    Judged where one term is missing and one of the shapes is that term (|cosine| > 0.999 at the true states).
    """
    if len(case.missing) != 1 or not _in_rates(case) or estimate.d is None:
        return {}
    i = list(case.deficient.states).index(case.missing[0].equation)
    true = _cosines(case.deficient, truth.x, truth.d[:, i])
    right = max(true, key=lambda name: true[name])
    if true[right] < 0.999:
        return {}
    said = _cosines(case.deficient, estimate.x, estimate.d[:, i])
    best = max(said, key=lambda name: said[name])
    return {"named_as": best, "named": int(best == right)}


def _in_rates(case: Case) -> bool:
    """Whether what is missing are terms of the rates of the states that an estimate has; a plant with states of its own
    has no terms at the estimated ones.
    """
    same = case.truth is not None and list(case.truth.states) == list(case.deficient.states)
    return bool(case.missing) and same and all(m.equation in case.deficient.states for m in case.missing)


def _cosines(model: Model, x: Array, d: Array) -> dict[str, float]:
    shapes = {text.format(s): f(x[:, j]) for j, s in enumerate(model.states) for text, f in SHAPES.items()}
    size = float(np.linalg.norm(d))
    return {s: float(abs(v @ d)) / max(float(np.linalg.norm(v)) * size, 1e-300) for s, v in shapes.items()}


def nees(error: Array, P: Array) -> float:
    """Mean over time of e' P^-1 e / n: 1 where the covariance is right, above where it is too small (Bar-Shalom).

    Directions in which P says "known exactly" are left out of the inverse; which these are does not depend on units.
    """
    variances = np.diagonal(P, axis1=1, axis2=2)
    sd = np.sqrt(np.maximum(variances, 0.0))
    known = np.where(sd > 0.0, sd, 1.0)
    size, axes = np.linalg.eigh(np.where((sd > 0.0)[:, :, None], P / (known[:, :, None] * known[:, None, :]), 0.0))
    along_axes = np.einsum("kji,kj->ki", axes, error / known)
    # The pseudo-inverse: what is rounding beside the largest eigenvalue counts as zero.
    unsure = size > EXACT * size.max(axis=1, keepdims=True)
    total = np.sum(np.where(unsure, along_axes**2 / np.where(unsure, size, 1.0), 0.0), axis=1)
    return float(np.mean(total) / error.shape[1])


def nis(model: Model, record: Record, estimate: Estimate) -> float | None:
    """Mean over time of the normalised innovation squared over the outputs; 1 where the filter is consistent.

    None where it is undefined.
    """
    e = whitened(model, record, estimate)
    if e is None:
        return None
    seen = np.isfinite(e)
    rows = seen.any(axis=1)
    return float(np.mean(np.nansum(e[rows] ** 2, axis=1) / seen[rows].sum(axis=1)))


def _output_rmse(model: Model, record: Record, estimate: Estimate) -> dict[str, float]:
    """Root mean square of z - h(xhat) by output: how closely the estimate follows the measurements, not a score."""
    rms = np.sqrt(np.nanmean(along.residuals(model, record, estimate.x)[0] ** 2, axis=0))
    return dict(zip(model.outputs, rms.tolist(), strict=True))
