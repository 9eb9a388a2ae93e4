"""Whether a residual is white and unrelated to the inputs: correlations with bands that chance leaves in 1 of 100."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from suite.record import Record

Array = npt.NDArray[np.float64]

LAGS = 20
BAND = 2.576  # standard deviations: 99 % of a normal variable


@dataclass(frozen=True)
class Cross:
    """Correlation r (2 LAGS + 1,) of an input with the residual `lags` samples later, and its 99 % band."""

    lags: npt.NDArray[np.int64]
    r: Array
    band: float


def whiteness(record: Record, e: Array, names: list[str]) -> dict[str, Array]:
    """Autocorrelation of the residual e (N, outputs) of each output at lags 1..20; missing samples are zero."""
    correlations = {}
    for j, name in enumerate(names):
        total, power = np.zeros(LAGS), 0.0
        for run in np.split(np.nan_to_num(e[:, j]), record.starts[1:]):
            power += float(run @ run)
            for lag in range(1, min(LAGS, len(run) - 1) + 1):
                total[lag - 1] += float(run[lag:] @ run[:-lag])
        correlations[name] = total / power if power > 0 else total
    return correlations


def band(record: Record, j: int) -> float:
    """What the autocorrelation of a white residual of output j stays within at 99 of 100 lags."""
    return BAND / float(np.sqrt(max(int(np.isfinite(record.y[:, j]).sum()), 1)))


def ljung_box(correlations: dict[str, Array], count: int, fitted: int) -> float:
    """p-value of the Ljung-Box statistic with 20 lags, the smallest over the outputs; 1 is white."""
    smallest = 1.0
    for r in correlations.values():
        lags = np.arange(1, len(r) + 1)
        room = np.maximum(count - lags, 1)
        statistic = count * (count + 2.0) * float((r**2 / room).sum())
        smallest = min(smallest, float(chdtrc(max(len(r) - fitted, 1), statistic)))
    return min(1.0, smallest * len(correlations))


def cross_correlation(record: Record, e: Array, outputs: list[str], inputs: list[str]) -> dict[str, dict[str, Cross]]:
    """Each input beside the residual e (N, outputs) of each output, at lags -20..20 (positive: the input came first).

    The band is Bartlett's for two unrelated series, each with its own correlation in time:
    var r = sum_k rho_e(k) rho_u(k) / N. A constant input has no correlation and is left out.
    """
    found: dict[str, dict[str, Cross]] = {}
    for j, output in enumerate(outputs):
        found[output] = {}
        for i, name in enumerate(inputs):
            there = np.isfinite(e[:, j])
            if there.sum() < 2 * LAGS or np.ptp(record.u[there, i]) == 0 or np.ptp(e[there, j]) == 0:
                continue
            own = np.where(there, e[:, j] - e[there, j].mean(), 0.0)
            force = record.u[:, i] - record.u[there, i].mean()
            found[output][name] = _cross(record, own, force)
    return found


def _cross(record: Record, e: Array, u: Array) -> Cross:
    lags = np.arange(-LAGS, LAGS + 1)
    most = max(LAGS, int(np.sqrt(len(e))))
    both, of_e, of_u = np.zeros(2 * LAGS + 1), np.zeros(most + 1), np.zeros(most + 1)
    for own, force in zip(np.split(e, record.starts[1:]), np.split(u, record.starts[1:]), strict=True):
        for k, lag in enumerate(lags.tolist()):
            if abs(lag) < len(own):
                both[k] += float(own[lag:] @ force[: len(own) - lag]) if lag >= 0 else float(own[:lag] @ force[-lag:])
        for lag in range(min(most + 1, len(own))):
            of_e[lag] += float(own[lag:] @ own[: len(own) - lag])
            of_u[lag] += float(force[lag:] @ force[: len(own) - lag])
    count = int((e != 0).sum())
    # Correlations at long lags are noise themselves: they fade out in the sum.
    shared = float((of_e * of_u * (1 - np.arange(most + 1) / (most + 1)))[1:].sum()) / (of_e[0] * of_u[0])
    return Cross(lags, both / np.sqrt(of_e[0] * of_u[0]), BAND * float(np.sqrt(max(1.0 + 2.0 * shared, 1.0) / count)))
