"""A filter's pass against filterpy's: the same model, record and prior, one run, from 2 to 100 states.

filterpy's filters are given this project's compiled step of the model and its Jacobian (see `baselines/_filterpy.py`),
so that what is compared is the filter alone; a step in plain Python would take them longer still. There is no unscented
filter among the kernels: filterpy's is compared with the extended one, which does the same work for the user.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from baselines._filterpy import Pass, extended, unscented
from suite.filtering import filtered

# Samples by states: filterpy's unscented filter takes 35 ms a sample at n = 100.
SAMPLES = {2: 801, 6: 401, 20: 101, 100: 21}


def _passes(
    plants: SimpleNamespace, n: int, kind: Callable[..., Pass]
) -> tuple[Callable[[], Any], Callable[[], Any], int]:
    plant = plants.paper() if n == 2 else plants.chain(n, SAMPLES[n])
    model, record, prior = plant.model, plant.record, plant.prior
    return (
        lambda: filtered(model, record, prior.x0, prior.P0, prior.Q, prior.R),
        lambda: kind(model, record, prior),
        len(record),
    )


@pytest.mark.parametrize("n", SAMPLES)
def test_the_extended_filter_against_filterpy(plants: SimpleNamespace, ratio: Any, n: int) -> None:
    """At least 200 times as fast at n = 2 and ahead at every n, with the same states and covariances."""
    ours, theirs, steps = _passes(plants, n, extended)
    mine, other = ours(), theirs()
    scale = np.abs(other.P).max()
    np.testing.assert_allclose(mine.x, other.x, rtol=0.0, atol=1e-9 * max(1.0, np.abs(other.x).max()))
    np.testing.assert_allclose(mine.P, other.P, rtol=0.0, atol=1e-9 * scale)
    ratio(
        f"extended Kalman filter, n = {n}", ours, "filterpy's EKF", theirs, unit="step", per=steps,
        at_least=200.0 if n == 2 else None,
    )  # fmt: skip


@pytest.mark.parametrize("n", SAMPLES)
def test_the_extended_filter_against_the_unscented_one_of_filterpy(plants: SimpleNamespace, ratio: Any, n: int) -> None:
    """At least 200 times as fast at n = 2 and ahead at every n."""
    ours, theirs, steps = _passes(plants, n, unscented)
    ratio(
        f"extended Kalman filter, n = {n}", ours, "filterpy's UKF", theirs, unit="step", per=steps,
        at_least=200.0 if n == 2 else None, turns=2, slow=n > 6,
    )  # fmt: skip
