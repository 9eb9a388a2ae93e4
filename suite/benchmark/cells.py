"""A cell of the matrix: one case under one condition, one estimator, one seed; and how one is run and judged."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from suite import plugins
from suite.benchmark import metrics, references
from suite.case import Case, Truth
from suite.errors import DataError
from suite.estimator import Estimator
from suite.prior import default_prior
from suite.record import Record

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """What identifies a row. Measured cases have noise 0 (as it is) and the number of the run for a seed."""

    case: str
    noise: float
    estimator: str
    variant: str
    seed: int

    @property
    def label(self) -> str:
        """The cell in one line, which `--only` looks in."""
        return f"{self.case} noise={self.noise:g} {self.estimator} {self.variant} seed={self.seed}"


def experiment(case: Case, noise: float, seed: int, data: Path | None) -> tuple[Record, Truth | None]:
    """The record, with its prior, that an estimator gets; and what the judge alone sees."""
    if case.truth is None:
        assert case.measured is not None
        runs = case.measured(data).runs
        record = runs[seed % len(runs)]
        return record.with_prior(default_prior(case.deficient, record, sensor_noise(case, record))), None
    record, truth = case.simulate(noise, seed)
    return record.with_prior(default_prior(case.deficient, record, truth.noise)), truth


def sensor_noise(case: Case, record: Record) -> Array:
    """Standard deviation of each sensor, (outputs,): as the model states it, else from third differences.

    The third difference of a smooth signal sampled fast is small, that of white noise has variance 20 sigma^2; its
    median absolute value is blind to outliers.
    """
    stated = [output.sigma for output in case.deficient.outputs.values()]
    thirds = np.diff(record.y, n=3, axis=0)
    rough = np.nanmedian(np.abs(thirds), axis=0) / 0.6745 / np.sqrt(20.0)
    return np.array([rough[j] if sigma is None else sigma for j, sigma in enumerate(stated)])


def run(cell: Cell, tuned: Mapping[str, float], data: Path | None) -> dict[str, Any]:
    """The row of a cell: whatever the estimator does, there is a row with a status and a reason in words."""
    case, reference = plugins.cases()[cell.case], cell.estimator in references.REFERENCES
    row: dict[str, Any] = {"status": "ok", "reason": "", "tuning": dict(tuned)}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            record, truth = experiment(case, cell.noise, cell.seed, data)
            if reference:
                return {**row, "steps": len(record), **references.row(cell.estimator, case, record, truth)}
            estimator = plugins.estimators()[cell.estimator]
            reason = estimator.skip(case.deficient, record)
            if reason is not None:
                return {**row, "status": "skipped", "reason": reason}
            _warm_up(case, estimator, record)
            start = time.perf_counter()
            estimate = estimator.estimate(case.deficient, record, **tuned)
            seconds = time.perf_counter() - start
            judged = metrics.judge(case, record, truth, estimate, estimator.kind)
        except DataError as error:
            return {**row, "status": "skipped", "reason": str(error)}
        except Exception as error:  # an estimator may fail in any way; the failure is its result
            kind = {"kind": "reference"} if reference else {}
            return {**row, **kind, "status": "error", "reason": f"{type(error).__name__}: {error}"}
    cost = {"seconds": seconds, "step_us": 1e6 * seconds / len(record), "steps": len(record), "peak_mb": peak()}
    return {**row, **cost, **judged}


_warm: set[tuple[str, str]] = set()


def _warm_up(case: Case, estimator: Estimator, record: Record) -> None:
    """The first call compiles or loads machine code: a short record takes that out of the time that is reported."""
    if (case.name, estimator.name) in _warm:
        return
    _warm.add((case.name, estimator.name))
    try:
        estimator.estimate(case.deficient, record.part(0, min(12, len(record))))
    except Exception:  # the whole record will show it
        return


def peak() -> float:
    """The process's largest resident memory so far, in MB; NaN where the system does not say."""
    try:
        import resource
    except ImportError:
        return float("nan")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
