"""A filter's normalised innovations, recovered from its updated states: what NIS and whiteness are made of."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite.estimator import Estimate
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


def whitened(model: Model, record: Record, estimate: Estimate) -> Array | None:
    """Innovations of unit covariance where the filter is consistent, (steps, outputs); None where undefined.

    From the updated state alone: with r = z - h(x+), R - H P+ H' = R S^-1 R and r = R S^-1 nu, hence
    r' (R - H P+ H')^-1 r = nu' S^-1 nu, and L^-1 r with L L' = R - H P+ H' is nu normalised. NaN where nothing was
    measured, or where the filter follows the measurement so closely that the difference is lost in rounding; None
    where that is half of the record.
    """
    if record.prior is None or estimate.P is None:
        return None
    R = record.prior.R
    e = np.full(record.y.shape, np.nan)
    # The first sample may have given the first state, so it is no innovation.
    for k in range(1, len(record)):
        seen = ~np.isnan(record.y[k])
        if not seen.any():
            continue
        r = (record.y[k] - model.output(record.t[k], estimate.x[k], record.u[k]))[seen]
        H = model.output_jacobian(record.t[k], estimate.x[k], record.u[k])[seen]
        gap = np.diag(R[seen]) - H @ estimate.P[k] @ H.T
        if np.linalg.eigvalsh(gap / np.max(R[seen]))[0] < 1e-9:
            continue
        e[k, seen] = np.linalg.solve(np.linalg.cholesky(gap), r)
    return e if np.isfinite(e).any(axis=1).sum() > len(record) // 2 else None
