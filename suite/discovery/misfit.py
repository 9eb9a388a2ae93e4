"""The model beside the record: its free run, the error by output, and the intervals in which it is worst."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincinv

from suite.discovery.fit import homotopy, prepare
from suite.discovery.noise import noise_variance
from suite.discovery.result import Comparison
from suite.discovery.stated import holds
from suite.discovery.whole import PIECE, Survey, survey
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


def frozen(model: Model) -> Model:
    """The model with every parameter exact, so that a fit moves initial states only."""
    return replace(model, parameters={name: replace(p, fixed=True) for name, p in model.parameters.items()})


def simulate(model: Model, record: Record, follow: float = 1.0) -> Array:
    """Free-run outputs (N, outputs) at the model's values; unknown initial states are fitted to the first part of
    each run, of length `follow`.
    """
    outputs = []
    for run in record.runs:
        lead = run if follow >= 1.0 else run.part(0, min(len(run), max(10, int(follow * len(run)))))
        problem = prepare(frozen(model), lead)
        point = homotopy(problem, problem.start).exact.point if problem.free_x0.any() else problem.start
        whole = replace(problem, record=run)
        outputs.append(whole.run(point, 0.0).Y)
    return np.concatenate(outputs)


def rmse(record: Record, Y: Array, names: list[str], rows: slice = slice(None)) -> dict[str, float]:
    """Root mean square of measured minus simulated, by output."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = (record.y[rows] - Y[rows]) ** 2
    there = ~np.isnan(record.y[rows])
    return {
        name: float(np.sqrt(np.mean(square[there[:, j], j]))) if there[:, j].any() else np.nan
        for j, name in enumerate(names)
    }


def residual(model: Model, record: Record, Y: Array, sigma: Array) -> Array:
    """Measured minus simulated in units of the noise, (N, outputs); angles by the shorter way round."""
    with np.errstate(over="ignore", invalid="ignore"):
        e = record.y - np.where(np.abs(Y) < 1e100, Y, np.nan)
    for j, output in enumerate(model.outputs.values()):
        if output.angle:
            e[:, j] = (e[:, j] + np.pi) % (2 * np.pi) - np.pi
    return e / np.where(sigma > 0, sigma, 1.0)


def compare(
    model: Model, record: Record, Y: Array | None = None, sigma: Array | None = None, over_all: Survey | None = None
) -> Comparison:  # fmt: skip
    """The model beside the record: error, fit % = 100 (1 - |y - Y| / |y - mean y|), the worst intervals.

    `over_all`: a simulation of the whole record of which `record` is an excerpt; the numbers are then of that. It is
    made here where Y is not given. `worst` is of the record itself.
    """
    over_all = _over_all(model, record) if Y is None else over_all
    Y = simulate(model, record) if Y is None else Y
    sigma = np.sqrt(noise_variance(model, record)) if sigma is None else sigma
    names = list(model.outputs)
    error, judged = rmse(record, Y, names), record
    if record.whole is not None and over_all is not None and holds(over_all, error, names):
        error, judged = dict(zip(names, over_all.error.tolist(), strict=True)), record.whole.record
    whole = judged is not record
    spread = {name: float(np.nanstd(judged.y[:, j])) for j, name in enumerate(names)}
    fit = {name: 100.0 * (1.0 - error[name] / spread[name]) if spread[name] > 0 else np.nan for name in names}
    worst = _worst(record, residual(model, record, Y, sigma))
    worst_of_all = _worst_pieces(judged, over_all) if whole and over_all is not None else worst
    words = [f"{fit[name]:.3g} % of {name} (error {error[name]:.3g}, noise {sigma[j]:.2g})"
             if np.isfinite(error[name]) else f"nothing of {name}, for its free run leaves the finite numbers"
             for j, name in enumerate(names)]  # fmt: skip
    if worst_of_all:
        run, first, last = worst_of_all[0]
        which = f" of run {run + 1}" if len(judged.starts) > 1 else ""
        words.append(f"the worst part is t = {first:.3g} to {last:.3g}{which}")
    return Comparison(Y, sigma, error, fit, worst, f"The model explains {'; '.join(words)}.", whole)


def _over_all(model: Model, record: Record) -> Survey | None:
    """The model's free run over the whole record that this is an excerpt of; None where it is none."""
    if record.whole is None:
        return None
    whole = record.whole.record
    problem = prepare(frozen(model), whole.part(0, min(int(whole.bounds[1]), PIECE)))
    return survey(problem, model.values, (), whole, length=record.whole.length)


def _worst_pieces(record: Record, found: Survey) -> tuple[tuple[int, float, float], ...]:
    """The three worst pieces of a whole record, by the rule of `_worst`."""
    home = np.searchsorted(record.bounds, found.first, side="right") - 1
    loud = found.square * found.count > _loud(np.maximum(found.count, 1))
    order = [k for k in np.argsort(-np.nan_to_num(found.square), kind="stable").tolist() if loud[k]]
    return tuple((int(home[k]), float(record.t[found.first[k]]), float(record.t[found.last[k] - 1])) for k in order[:3])


def _worst(record: Record, e: Array) -> tuple[tuple[int, float, float], ...]:
    """The three worst of twenty equal parts of each run, where the mean square residual is far above the noise."""
    found = []
    bounds = record.bounds
    for r, (first, last) in enumerate(pairwise(bounds.tolist())):
        for part in np.array_split(np.arange(first, last), min(20, last - first)):
            there = e[part][np.isfinite(e[part])]
            level = float(np.mean(there**2)) if len(there) else 0.0
            # Above the 99.9 % quantile of what noise alone would give.
            if len(there) and level * len(there) > _loud(len(there)):
                found.append((level, r, float(record.t[part[0]]), float(record.t[part[-1]])))
    return tuple((r, a, b) for _, r, a, b in sorted(found, reverse=True)[:3])


def _loud(count: npt.ArrayLike) -> Any:
    """The 99.9 % quantile of chi-square; scipy.stats would take half a second to load."""
    return 2.0 * gammaincinv(0.5 * np.asarray(count), 0.999)
