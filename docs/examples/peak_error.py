"""How far the worst state is off at the worst sample."""

import numpy as np

from suite.metric import Judged, Metric


def _peak(judged: Judged) -> float | None:
    """Largest error of any state over its standard deviation; None where the case is measured."""
    if judged.truth is None:
        return None
    return float((np.abs(judged.estimate.x - judged.truth.x) / judged.truth.x.std(axis=0)).max())


PEAK_ERROR = Metric("peak_error", "largest error of any state over its standard deviation", _peak, "lower")
