"""A cell of the recovery benchmark: one case under one condition, one method, one seed; does it name what is missing?

The method gets model, record and library. Truth, true output and true noise stay with the judge.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from suite import plugins
from suite.benchmark import rivals, sparse, verdicts
from suite.benchmark.cells import Cell
from suite.benchmark.conditions import Trial, inapplicable, trial
from suite.benchmark.rivals import Answer
from suite.errors import DataError


@dataclass(frozen=True)
class Method:
    """A way to name the missing effect: what it answers, or why it cannot be asked."""

    answer: Callable[[Trial], Answer]
    skip: Callable[[Trial], str | None] = lambda trial: None


OURS = "unmodelled"
RIVALS = {
    "correlation": Method(rivals.correlation),
    "smoothed-regression": Method(rivals.smoothed_regression),
    "pysindy": Method(sparse.stlsq, sparse.skip),
    "pysindy-ensemble": Method(sparse.ensemble, sparse.skip),
    "weak-pysindy": Method(sparse.weak, sparse.skip),
}


def recovers(cell: Cell) -> bool:
    """Whether a cell is one of the recovery benchmark."""
    return cell.estimator == OURS or cell.estimator in RIVALS


def run(cell: Cell, tuned: Any = None, data: Path | None = None) -> dict[str, Any]:
    """The row of a cell; whatever the method does, there is one, with a status and a reason in words."""
    row: dict[str, Any] = {"kind": "recovery", "status": "ok", "reason": ""}
    case, effects = plugins.cases()[cell.case], plugins.effects()
    reason = inapplicable(case, cell.variant, effects)
    if reason is not None:
        return {**row, "status": "skipped", "reason": f"{case.name} has no condition {cell.variant!r}: {reason}"}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            given = trial(case, cell.variant, cell.noise, cell.seed, effects)
            row |= {"missing": _written(given.truth), "samples": len(given.record)}
            if cell.estimator == OURS:
                return {**row, **verdicts.row(given)}
            method = RIVALS[cell.estimator]
            reason = method.skip(given)
            if reason is not None:
                return {**row, "status": "skipped", "reason": reason}
            start = time.perf_counter()
            answer = method.answer(given)
            return {**row, "seconds": time.perf_counter() - start, **judged(given, answer)}
        except DataError as error:
            return {**row, "status": "skipped", "reason": str(error)}
        except Exception as error:  # a method may fail in any way; the failure is its result
            return {**row, "status": "error", "reason": f"{type(error).__name__}: {error}"}


def judged(trial: Trial, answer: Answer) -> dict[str, Any]:
    """A rival's answer beside the truth. First: its best ones, as many as are missing, are the missing ones."""
    truth = trial.truth
    places = [place for place, name in enumerate(answer.ranked, 1) if name in truth]
    return {
        "named": _written(answer.named),
        "alarm": bool(answer.named),
        "first": bool(truth) and set(answer.ranked[: len(truth)]) == truth,
        "exact": bool(truth) and set(answer.named) == truth,
        "rank": max(places) if len(places) == len(truth) > 0 else None,
        "candidates": answer.candidates,
    }


def _written(names: Any) -> str:
    """A set of effects in a word: effect@equation, joined by +."""
    return "+".join(f"{effect}@{equation}" for effect, equation in sorted(names))
