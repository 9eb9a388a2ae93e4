"""How often the estimator's own 95 % band holds the true state."""

from __future__ import annotations

import numpy as np

from suite.metric import Judged, Metric


def _coverage(judged: Judged) -> float | None:
    """Share of samples and states with |x - xhat| <= 1.96 sqrt(P_ii); states that P calls exact are left out."""
    P, truth = judged.estimate.P, judged.truth
    if P is None or truth is None:
        return None
    sd = np.sqrt(np.clip(np.diagonal(P, axis1=1, axis2=2), 0.0, None))
    unsure = sd > 0
    inside = np.abs(judged.estimate.x - truth.x) <= 1.96 * sd
    return float(inside[unsure].mean()) if unsure.any() else None


COVERAGE = Metric(
    "coverage", "share of true states inside the estimator's own 95 % band; 0.95 is right", _coverage, "neither"
)
