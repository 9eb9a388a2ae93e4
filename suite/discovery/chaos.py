"""Plants that forget where they started: a record is cut where no simulation could reach back further.

Along the measured path the tangent of the model tells how fast two neighbouring runs part. Beyond FORGOTTEN no first
state can be known well enough for an exact simulation of the whole; the record is then taken in stretches over which
they part by PARTED at most, each with a first state of its own (multiple shooting; Bock 1981).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.kernels.integrate import workspace
from suite.kernels.parting import parting
from suite.kernels.types import arrays
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

FORGOTTEN = 8.0  # logarithm of how far neighbours part over a run, from which it is cut
PARTED = 3.0  # the same over a stretch
SHORTEST = 40  # samples of a stretch
ROOM = 1_000_000  # numbers of the tangents that are kept at a time


def stretches(model: Model, record: Record, path: Array) -> Record:
    """The record with the runs that no simulation can span cut into stretches; itself where there are none.

    `path` (N, n) are the states at the samples.
    """
    starts: list[int] = []
    names: list[str] = []
    for number, (first, last) in enumerate(zip(record.bounds[:-1].tolist(), record.bounds[1:].tolist(), strict=True)):
        cuts, growth = [first], _growth(model, record, path, first, last, exact=False)
        if growth[-1] > FORGOTTEN:
            growth = _growth(model, record, path, first, last, exact=True)
        if growth[-1] > FORGOTTEN:
            for k in range(first + 1, last - SHORTEST):
                if growth[k - first] - growth[cuts[-1] - first] > PARTED and k - cuts[-1] >= SHORTEST:
                    cuts.append(k)
        starts += cuts
        name = record.names[number] if len(record.names) == len(record.starts) else record.source
        names += [f"{name}, from t = {record.t[k]:.4g}" for k in cuts] if len(cuts) > 1 else [name]
    return replace(record, starts=tuple(starts), names=tuple(names)) if len(starts) > len(record.starts) else record


def _growth(model: Model, record: Record, path: Array, first: int, last: int, *, exact: bool) -> Array:
    """Logarithm of the factor by which neighbours part from a run's first sample on, (samples,); or a bound of it.

    The bound is the root of the sum of squares of all directions, which costs nothing, the factor the largest of them.
    """
    n, program = len(model.states), model.program
    scale = np.ptp(path[first:last], axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    growth, total, V = np.zeros(last - first), 0.0, np.eye(n)
    off, none = program.all_off(), np.zeros(0, dtype=np.int64)
    work = workspace(n, program.inputs, program.parameters, 0)
    most = max(ROOM // (n * n), 1)
    for begin in range(first, last - 1, most):
        end = min(begin + most, last - 1)
        part = slice(begin, end + 1)
        tangents, logs = np.zeros((end - begin, n, n)), np.zeros(end - begin)
        made = parting(
            program.step_when(off), program.rate, *arrays(record.t[part], record.u[part], model.linear_inputs),
            *arrays(model.values), off, none, *arrays(path[part], scale), V, np.zeros(n), np.zeros((n, n)), work,
            tangents, logs,
        )  # fmt: skip
        sizes = np.log(np.linalg.norm(tangents[:made], 2, axis=(1, 2))) if exact else 0.0
        growth[begin + 1 - first : begin + 1 - first + made] = total + np.cumsum(logs[:made]) + sizes
        if made < end - begin:
            return growth
        total += float(logs.sum())
    return np.maximum.accumulate(growth)
