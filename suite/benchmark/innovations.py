"""A filter's normalised innovations, recovered from its updated states: what NIS and whiteness are made of."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite import along
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
    seen = ~np.isnan(record.y)
    # The first sample may have given the first state, so it is no innovation.
    seen[0] = False
    gap, H = along.residuals(model, record, estimate.x)
    r = np.where(seen, gap, 0.0)
    H = np.where(seen[:, :, None], H, 0.0)
    # Channels that are not seen are kept apart with a residual of zero and a variance that never is the smallest.
    largest = np.where(seen.any(axis=1), np.max(np.where(seen, R, 0.0), axis=1), 1.0)
    spread = -H @ estimate.P @ H.transpose(0, 2, 1)
    np.einsum("kii->ki", spread)[...] += np.where(seen, R, largest[:, None])
    sound = np.flatnonzero(seen.any(axis=1) & np.isfinite(spread).all(axis=(1, 2)))
    sound = sound[np.linalg.eigvalsh(spread[sound] / largest[sound, None, None])[:, 0] >= 1e-9]
    e = np.full(record.y.shape, np.nan)
    e[sound] = np.linalg.solve(np.linalg.cholesky(spread[sound]), r[sound, :, None])[:, :, 0]
    e[~seen] = np.nan
    return e if np.isfinite(e).any(axis=1).sum() > len(record) // 2 else None
