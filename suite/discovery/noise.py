"""How noisy the sensors are, read off the record alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

OUTLIER = 6.0  # robust standard deviations by which a sample stands out from its neighbours
MOST = 0.05  # of an output's samples: where more than that stand out, they are no outliers
PART = 131_072  # samples whose neighbours are looked at together
QUIETEST = 1e-7  # of an output's range: below it the integrator, not the sensor, makes the error


def noise_variance(model: Model, record: Record, stated: bool = True) -> Array:
    """Variance of one sample of each output, (outputs,): the file's sigma (if `stated`), else from fourth differences.

    On even sampling var(4th difference)/70 is the variance of white noise under any cubic; on uneven sampling the
    fourth divided difference, scaled to the same expectation. Squares are clipped at nine times their robust scale, so
    that a few jumps do not count as noise.
    """
    variances = []
    for j, output in enumerate(model.outputs.values()):
        span = float(spans(record)[j])
        floor = (QUIETEST * (span or 1.0)) ** 2
        if stated and output.sigma is not None:
            variances.append(max(output.sigma**2, floor))
            continue
        squares = np.concatenate([_innovation(run.t, unrolled(run, j, output.angle)) for run in record.runs])
        if len(squares) == 0:
            variances.append(max((0.01 * span) ** 2, floor))
            continue
        # For Gaussian noise the median of squares is 0.4549 of their mean, and clipping at 9 takes 0.65 % off it.
        robust = float(np.median(squares)) / 0.4549
        clipped = float(np.minimum(squares, 9.0 * robust).mean()) / 0.9935 if robust > 0 else float(squares.mean())
        variances.append(max(clipped, floor))
    return np.array(variances)


def spans(record: Record) -> Array:
    """Range of each output, (outputs,); 0 where it is constant or missing throughout."""
    return np.array([float(np.ptp(y[~np.isnan(y)])) if (~np.isnan(y)).any() else 0.0 for y in record.y.T])


def unrolled(run: Record, j: int, angle: bool) -> Array:
    """Output j of one run, (N,), without the jumps of a wrapped angle."""
    y = run.y[:, j].copy()
    if angle:
        there = ~np.isnan(y)
        y[there] = np.unwrap(y[there])
    return y


def _innovation(t: Array, y: Array) -> Array:
    """Squared departures of each sample from the cubic through its neighbours, each an estimate of the variance."""
    there = ~np.isnan(y)
    t, y = t[there], y[there]
    if len(y) < 8:
        return np.zeros(0)
    # A window of five in each row; of very many rows in parts, for they are 25 numbers each.
    parts = range(0, len(y) - 4, PART)
    return np.concatenate([_departures(t[at : at + PART + 4], y[at : at + PART + 4]) for at in parts])


def _departures(t: Array, y: Array) -> Array:
    """The squared departure of each of five neighbours' last from the cubic through the others, (N - 4,)."""
    # Weights of the fourth divided difference over five neighbours; their squares scale it to one sample's variance.
    windows = np.lib.stride_tricks.sliding_window_view(t, 5)
    values = np.lib.stride_tricks.sliding_window_view(y, 5)
    unit = windows[:, -1] - windows[:, 0]
    steps = (windows[:, :, None] - windows[:, None, :]) / unit[:, None, None]
    steps[:, np.arange(5), np.arange(5)] = 1.0
    weights = 1.0 / steps.prod(axis=2)
    return np.asarray((weights * values).sum(axis=1) ** 2 / (weights**2).sum(axis=1))


def spikes(y: Array, sigma: float) -> npt.NDArray[np.bool_]:
    """Single samples that stand out from the median of their five neighbours."""
    if len(y) < 7:
        return np.zeros(len(y), dtype=bool)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(y, 2, mode="reflect"), 5)
    found = np.zeros(len(y), dtype=bool)
    for at in range(0, len(y), PART):
        part = windows[at : at + PART]
        middle = np.median(part, axis=1)
        reach = np.sort(np.abs(part - middle[:, None]), axis=1)[:, 3]
        found[at : at + PART] = np.abs(y[at : at + PART] - middle) > OUTLIER * np.maximum(sigma, reach)
    return found


def without_outliers(model: Model, record: Record) -> tuple[Record, int]:
    """The record with the samples that stand out alone marked as missing, and how many there are.

    One that stands out beside another is not taken for an outlier: the plant itself may have moved.
    """
    y = without_spikes(model, record, noise_variance(model, record))
    dropped = int(np.isnan(y).sum() - np.isnan(record.y).sum())
    return (replace(record, y=y), dropped) if dropped else (record, 0)


def without_spikes(model: Model, record: Record, R: Array) -> Array:
    """The outputs (N, outputs) without the samples that stand out alone, at noise variances R (outputs,)."""
    y = record.y.copy()
    sigma = np.sqrt(R)
    for first, last in zip(record.bounds[:-1], record.bounds[1:], strict=True):
        for j, output in enumerate(model.outputs.values()):
            values = unrolled(record.part(first, last), j, output.angle)
            there = np.flatnonzero(~np.isnan(values))
            found = spikes(values[there], max(float(sigma[j]), 1e-300))
            alone = found & ~np.roll(found, 1) & ~np.roll(found, -1)
            if 0 < alone.sum() <= MOST * len(there):
                y[first + there[alone], j] = np.nan
    return y
