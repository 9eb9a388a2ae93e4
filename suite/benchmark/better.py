"""What better methods reach on the plant of Table 1: a3 over seeds, by method, by noise and by what is measured.

Noise is absolute, the same standard deviation for each measured state, known to all methods; x0 = 0 is known. Tuning
is by maximum likelihood of the innovations on the record itself, never by the truth: alpha of the white-noise family
(invariant embedding, the batch smoother) by the EKF that it equals, the walk's density of the disturbance family by
the compiled EKF with a disturbance state.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar
from scipy.signal import savgol_filter

from suite import plugins
from suite.benchmark import pool
from suite.benchmark.progress import Progress
from suite.benchmark.table_one import TRUE_A3, measuring, regress
from suite.benchmark.worker import Failure, Task
from suite.case import Case
from suite.estimator import Estimate
from suite.filtering import filtered
from suite.model import Model, Parameter
from suite.prior import default_prior
from suite.record import Record

Array = npt.NDArray[np.float64]

NOISES = (0.01, 0.05, 0.1, 0.2)
MEASURED = (("x1", "x2"), ("x2",))
# Samples and degree of the Savitzky-Golay window: 1.55 s, a quarter of the drive's period.
WINDOW, DEGREE = 31, 4


@dataclass(frozen=True)
class Entry:
    """a3 of one method: its values over the seeds, or the reason why there are none."""

    method: str
    measured: tuple[str, ...]
    noise: float
    values: tuple[float, ...]
    reason: str = ""

    @property
    def text(self) -> str:
        """Mean +- standard deviation in 1e-4, or a dash."""
        if not self.values:
            return "-"
        sd = float(np.std(self.values, ddof=1)) if len(self.values) > 1 else 0.0
        return f"{1e4 * np.mean(self.values):.1f} +- {1e4 * sd:.1f}"


def table(seeds: int = 5, noises: Sequence[float] = NOISES, jobs: int | None = None) -> list[Entry]:
    """Every method under every noise and measurement, `seeds` records each, in processes."""
    blocks = [(measured, noise, seed) for measured in MEASURED for noise in noises for seed in range(seeds)]
    tasks = [Task("suite.benchmark.better:one", block, block) for block in blocks]
    done: dict[Any, Any] = {}
    with Progress("records", len(tasks)) as progress:
        for task, outcome in pool.run(tasks, jobs or os.cpu_count() or 1, 600.0):
            done[task.label] = outcome
            progress.step(f"{task.label[0]} {task.label[1]:g}")
    entries = []
    for measured in MEASURED:
        for noise in noises:
            runs = [done[measured, noise, seed] for seed in range(seeds)]
            entries += [_entry(method, measured, noise, runs) for method in METHODS]
            entries.append(Entry("Cramer-Rao bound (sd)", measured, noise, (cramer_rao(measured, noise),)))
    return entries


def one(measured: tuple[str, ...], noise: float, seed: int) -> dict[str, float | str]:
    """a3 by every method on one record, or in words why a method gives none."""
    model, record = experiment(measured, noise, seed)
    alpha, walk = white_weight(model, record), walk_density(model, record)
    found: dict[str, float | str] = {}
    for method, work in METHODS.items():
        try:
            found[method] = work(model, record, alpha, walk)
        except Exception as error:  # a method that cannot run leaves its reason in the table
            found[method] = f"{type(error).__name__}: {error}"
    return found


def _entry(method: str, measured: tuple[str, ...], noise: float, runs: Sequence[Any]) -> Entry:
    """A method's values over the runs; the first failure takes their place."""
    for run in runs:
        reason = run.reason if isinstance(run, Failure) else run[method]
        if isinstance(reason, str):
            return Entry(method, measured, noise, (), reason)
    return Entry(method, measured, noise, tuple(run[method] for run in runs))


def experiment(measured: tuple[str, ...], noise: float, seed: int) -> tuple[Model, Record]:
    """The deficient model and a record of the named states with white noise of standard deviation `noise`."""
    case: Case = plugins.cases()["paper-cubic"]
    record, _ = case.simulate(0.0, 0)
    record = replace(record, y=record.y + noise * np.random.default_rng(seed).standard_normal(record.y.shape))
    columns = [list(case.deficient.outputs).index(name) for name in measured]
    model = measuring(case.deficient, measured)
    record = replace(record, y=record.y[:, columns].copy())
    return model, record.with_prior(default_prior(model, record, np.full(len(columns), noise)))


def white_weight(model: Model, record: Record) -> float:
    """The alpha of largest likelihood: the innovations' of the EKF with process-noise density Q / alpha."""
    prior = record.prior
    assert prior is not None

    def loss(log_alpha: float) -> float:
        run = filtered(model, record, prior.x0, prior.P0, prior.Q / np.exp(log_alpha), prior.R, spread=True)
        return -run.log_likelihood if np.isfinite(run.log_likelihood) else 1e300

    return float(np.exp(minimize_scalar(loss, bounds=(-10.0, 12.0), method="bounded").x))


def walk_density(model: Model, record: Record) -> float:
    """q_scale of largest likelihood of the model with a random-walk disturbance."""
    smoother = plugins.estimators()["random-walk-smoother"]

    def loss(log_q: float) -> float:
        report = smoother.estimate(model, record, q_scale=float(np.exp(log_q))).report
        return -float(report["log likelihood"]) if report else 1e300

    return float(np.exp(minimize_scalar(loss, bounds=(-12.0, 10.0), method="bounded").x))


def _by_regression(name: str, family: str) -> Callable[[Model, Record, float, float], float]:
    def work(model: Model, record: Record, alpha: float, walk: float) -> float:
        tuned = {"alpha": alpha} if family == "white" else {"q_scale": walk}
        return regress(plugins.estimators()[name].estimate(model, record, **tuned))

    return work


def _refit(model: Model, record: Record, alpha: float, walk: float) -> float:
    """Maximum likelihood after adding the term; a1 and a2 are known, as they are to the other methods."""
    from suite.discovery.fit import fit

    known = {name: replace(parameter, fixed=True) for name, parameter in model.parameters.items()}
    grown = replace(model, parameters=known).plus("x1", "-a3*x2**3", {"a3": Parameter(0.0, free=True)})
    sigma = np.sqrt(record.prior.R) if record.prior is not None else np.ones(record.y.shape[1])
    outputs = {
        name: replace(output, sigma=float(s)) for (name, output), s in zip(grown.outputs.items(), sigma, strict=True)
    }
    result: Any = fit(replace(grown, outputs=outputs), record)
    return float(result.parameters["a3"][0])


def _savitzky_golay(model: Model, record: Record, alpha: float, walk: float) -> float:
    """Smooth and differentiate, then least squares of x1' - f1 = -a3 x2^3 (Savitzky and Golay 1964)."""
    dt = float(np.median(record.dt))
    names = list(model.outputs)
    x2 = savgol_filter(record.y[:, names.index("x2")], WINDOW, DEGREE)
    if "x1" in names:
        z, order = record.y[:, names.index("x1")], 1
        x1 = savgol_filter(z, WINDOW, DEGREE)
    else:
        z, order = record.y[:, names.index("x2")], 2
        x1 = savgol_filter(z, WINDOW, DEGREE, deriv=1, delta=dt)
    slope = savgol_filter(z, WINDOW, DEGREE, deriv=order, delta=dt)
    x = np.column_stack([x1, x2])
    d = slope - np.array([model.rate(t, state)[0] for t, state in zip(record.t, x, strict=True)])
    return regress(Estimate(x=x, d=np.column_stack([d, 0 * d])))


METHODS: dict[str, Callable[[Model, Record, float, float], float]] = {
    "invariant embedding, likelihood-tuned": _by_regression("generalized-ie", "white"),
    "discrete invariant embedding, likelihood-tuned": _by_regression("generalized-ie-discrete", "white"),
    "batch (minimum model error)": _by_regression("minimum-model-error", "white"),
    "random-walk disturbance, RTS": _by_regression("random-walk-smoother", "walk"),
    "EKF with disturbance (filterpy)": _by_regression("ekf-disturbance", "walk"),
    "UKF with disturbance (filterpy)": _by_regression("ukf-disturbance", "walk"),
    "Savitzky-Golay and least squares": _savitzky_golay,
    "maximum likelihood after adding the term": _refit,
}


def cramer_rao(measured: tuple[str, ...], noise: float) -> float:
    """Smallest standard deviation of an unbiased a3: sigma / |dy/da3|, by a central difference of the true plant."""
    case: Case = plugins.cases()["paper-cubic"]
    assert case.truth is not None
    columns = [list(case.deficient.outputs).index(name) for name in measured]
    step = 1e-3 * TRUE_A3
    ends = []
    for sign in (1.0, -1.0):
        moved = replace(case, truth=case.truth.with_values({"a3": TRUE_A3 + sign * step}))
        ends.append(moved.simulate(0.0, 0)[0].y[:, columns])
    return float(noise / np.linalg.norm((ends[0] - ends[1]) / (2.0 * step)))


def cells(entries: Sequence[Entry], measured: tuple[str, ...]) -> list[list[str]]:
    """The entries of one measurement as rows of text, a3 in 1e-4."""
    noises = list(dict.fromkeys(entry.noise for entry in entries))
    rows = [["a3 x 1e4 (true: 195)", *(f"noise {noise:g}" for noise in noises)]]
    for method in dict.fromkeys(entry.method for entry in entries):
        found = {e.noise: e for e in entries if e.method == method and e.measured == measured}
        if method.startswith("Cramer"):
            rows.append([method, *(f"{1e4 * found[noise].values[0]:.1f}" for noise in noises)])
        else:
            rows.append([method, *(found[noise].text for noise in noises)])
    return rows
