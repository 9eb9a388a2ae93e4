"""Whether a filter's innovations are white: what it left unexplained is then noise."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from suite.benchmark.innovations import whitened
from suite.metric import Judged, Metric

Array = npt.NDArray[np.float64]


def _first_correlation(judged: Judged) -> float | None:
    """Correlation of neighbouring normalised innovations, pooled over their components; 0 is white."""
    if judged.kind != "filter":
        return None
    e = whitened(judged.case.deficient, judged.record, judged.estimate)
    if e is None:
        return None
    pairs = np.isfinite(e[1:]) & np.isfinite(e[:-1])
    power = float(np.nanmean(e**2))
    return float((e[1:][pairs] * e[:-1][pairs]).mean() / power) if pairs.sum() > 20 and power > 0 else None


WHITENESS = Metric(
    "innovation_r1",
    "correlation of neighbouring normalised innovations of a filter; 0 is white",
    _first_correlation,
    "neither",
)
