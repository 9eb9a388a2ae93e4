"""Inputs as they act: later than they were measured, where the model says so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


def acting(record: Record, model: Model) -> Record:
    """The record with every delayed input as it acts, at the model's values of the delays."""
    delays = {j: model.parameters[entry.delay].value for j, entry in enumerate(model.inputs.values()) if entry.delay}
    if not delays:
        return record
    u = record.u.copy()
    for j, delay in delays.items():
        u[:, j] = late(record, j, delay)[0]
    return replace(record, u=u)


def late(record: Record, j: int, delay: float) -> tuple[Array, Array]:
    """Input j as it was `delay` before each sample, and its slope there, (N,) each; before a run it was as at first.

    Between samples it runs on a line. For an input that is held this is the mean over a step of the delayed staircase.
    """
    values, slopes = np.zeros(len(record)), np.zeros(len(record))
    for first, last in zip(record.bounds[:-1], record.bounds[1:], strict=True):
        t, u = record.t[first:last], record.u[first:last, j]
        at = t - delay
        values[first:last] = np.interp(at, t, u)
        piece = np.clip(np.searchsorted(t, at, side="left"), 1, len(t) - 1)
        slope = (u[piece] - u[piece - 1]) / (t[piece] - t[piece - 1])
        slopes[first:last] = np.where((at < t[0]) | (at > t[-1]), 0.0, slope)
    return values, slopes


def channels(record: Record, delays: Mapping[int, float], held: Mapping[int, bool]) -> Array:
    """The inputs followed by what the engine needs beside them, (N, more): for each delayed input its late value, its
    slope and its delay; for each input of `held` itself again, to be held the other way.
    """
    columns = [record.u]
    for j, delay in delays.items():
        value, slope = late(record, j, delay)
        columns.append(np.column_stack([value, slope, np.full(len(record), delay)]))
    columns += [record.u[:, [j]] for j in held]
    return np.ascontiguousarray(np.concatenate(columns, axis=1))
