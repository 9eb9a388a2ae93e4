"""Mistakes with columns: one read with the wrong sign, two read in each other's place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from suite.discovery.fit import Hypothesis, homotopy, prepare
from suite.discovery.identify import left
from suite.errors import DataError
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

LOUD = 4.0  # mean squared error in noise units from which a mistake is looked for
GAIN = 50.0  # of -2 ln likelihood: what undoing a mistake must gain at the likeliest process noise


@dataclass(frozen=True)
class Mixup:
    """A mistake that would explain much of the error: what to write about it, and what undoing it gains in -2 ln
    likelihood.
    """

    sentence: str
    gain: float


def mixups(model: Model, record: Record, base: Hypothesis) -> list[Mixup]:
    """The mistakes that are worth undoing, the likeliest first; none where the model explains the record.

    They are compared with process noise in the model, which stands for whatever else it lacks: a model with a missing
    effect predicts the next samples badly, one with a wrong sign in a column worse.
    """
    if left(base) < LOUD:
        return []
    found = []
    for sentence, changed in _undone(model, record):
        try:
            problem = prepare(model, changed)
            gain = base.best.L - homotopy(problem, problem.start).best.L
        except (DataError, np.linalg.LinAlgError):
            # A plant that cannot run on such data was not measured so.
            continue
        if gain > GAIN:
            found.append(Mixup(sentence, float(gain)))
    return sorted(found, key=lambda mixup: -mixup.gain)


def _undone(model: Model, record: Record) -> Iterator[tuple[str, Record]]:
    """Every record with one mistake undone. An output in an input's place is not among them: likelihoods of different
    measurements do not compare.
    """
    columns, m = np.column_stack([record.y, record.u]), record.y.shape[1]
    names = [*model.outputs, *model.inputs]
    for j, name in enumerate(names):
        flipped = columns.copy()
        flipped[:, j] *= -1.0
        yield (
            f"{name} fits with the other sign; is its column, or its sensor, the wrong way round?",
            _split(record, flipped),
        )
    for i, j in (*combinations(range(m), 2), *combinations(range(m, len(names)), 2)):
        swapped = columns.copy()
        swapped[:, [i, j]] = columns[:, [j, i]]
        yield (
            f"{names[i]} and {names[j]} fit in each other's place; are their columns swapped?",
            _split(record, swapped),
        )


def _split(record: Record, columns: Array) -> Record:
    m = record.y.shape[1]
    return replace(record, y=columns[:, :m].copy(), u=columns[:, m:].copy())
