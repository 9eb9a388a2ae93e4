"""The compiled extended Kalman filter is at least 150 times as fast as filterpy's, and gives the same numbers."""

from __future__ import annotations

import time

import numpy as np
import pytest

from baselines._filterpy import extended
from suite.case import Case, Experiment
from suite.filtering import filtered
from suite.model import Initial, Model, Output, Parameter
from suite.record import Prior, Record

ROUNDS = 3


def record_of_the_plant() -> tuple[Model, Record, Prior]:
    """The plant of Raol (2016), (100)-(101), 40 s at 0.05 s, both states measured."""
    model = Model(
        name="driven oscillator with a cubic spring",
        states={"x1": "2.5*cos(t) - a1*x1 - a2*x2 - a3*x2**3", "x2": "x1"},
        parameters={"a1": Parameter(0.68), "a2": Parameter(1.0), "a3": Parameter(0.0195)},
        outputs={"z1": Output("x1", "z1"), "z2": Output("x2", "z2")},
        initial={"x1": Initial(0.0), "x2": Initial(0.0)},
    )
    record, _ = Case("speed", "", model, model, Experiment(40.0, 0.05, (0.0, 0.0))).simulate(0.05, 1)
    return model, record, Prior(np.zeros(2), 0.1 * np.eye(2), np.array([0.01, 0.01]), np.array([0.05, 0.0]))


def test_the_kernel_is_150_times_as_fast_as_filterpy(benchmark: pytest.FixtureRequest) -> None:
    """One run each over 801 samples of the paper's plant, the best of three; the states agree to 1e-9."""
    model, record, prior = record_of_the_plant()
    ours = filtered(model, record, prior.x0, prior.P0, prior.Q, prior.R)
    seconds = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        theirs = extended(model, record, prior)
        seconds.append(time.perf_counter() - start)
    np.testing.assert_allclose(ours.x, theirs.x, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(ours.P, theirs.P, rtol=0.0, atol=1e-9)
    benchmark.pedantic(filtered, args=(model, record, prior.x0, prior.P0, prior.Q, prior.R), rounds=20, warmup_rounds=2)
    ratio = min(seconds) / benchmark.stats.stats.min
    print(f"filterpy {min(seconds) / len(record) * 1e6:.1f} us a step, {ratio:.0f} times the kernel's")
    assert ratio >= 150.0
