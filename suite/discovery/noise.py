"""How noisy the sensors are, read off the record alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

QUIETEST = 1e-7  # of an output's range: below it the integrator, not the sensor, makes the error


def noise_variance(model: Model, record: Record) -> Array:
    """Variance of one sample of each output, (outputs,): the file's sigma, else from fourth differences.

    On even sampling var(4th difference)/70 is the variance of white noise under any cubic; on uneven sampling the
    fourth divided difference, scaled to the same expectation. Squares are clipped at nine times their robust scale, so
    that a few jumps do not count as noise.
    """
    variances = []
    for j, output in enumerate(model.outputs.values()):
        span = float(spans(record)[j])
        floor = (QUIETEST * (span or 1.0)) ** 2
        if output.sigma is not None:
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
    # Weights of the fourth divided difference over five neighbours; their squares scale it to one sample's variance.
    windows = np.lib.stride_tricks.sliding_window_view(t, 5)
    values = np.lib.stride_tricks.sliding_window_view(y, 5)
    unit = windows[:, -1] - windows[:, 0]
    steps = (windows[:, :, None] - windows[:, None, :]) / unit[:, None, None]
    steps[:, np.arange(5), np.arange(5)] = 1.0
    weights = 1.0 / steps.prod(axis=2)
    return np.asarray((weights * values).sum(axis=1) ** 2 / (weights**2).sum(axis=1))
