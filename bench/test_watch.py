"""A sample of the watcher, with three filters and the alarm, costs at most 50 microseconds."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pytest

from suite.case import Case, Experiment
from suite.model import Initial, Model, Output, Parameter
from suite.watch import Watcher

SPRING = Model(
    name="oscillator",
    states={"p": "v", "v": "2.5*cos(t) - c*v - k*p"},
    parameters={"c": Parameter(0.68, sd=0.05), "k": Parameter(1.0, sd=0.05)},
    outputs={"pos": Output("p", "pos", sigma=0.05)},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
CUBIC = SPRING.plus("v", "-a*p**3", {"a": Parameter(0.0, free=True)})


def test_a_sample_takes_at_most_50_microseconds(benchmark: pytest.FixtureRequest) -> None:
    """Four, five and five states with an effect watched: the least time of 200 rounds of 50 samples, per sample."""
    record, _ = Case("watch", "", SPRING, SPRING, Experiment(60.0, 0.05, (0.0, 0.0))).simulate(0.05, 1)
    watcher = Watcher(SPRING, record.part(0, 40), CUBIC, ["a"])
    given, time = cycle(zip(record.u, record.y, strict=True)), iter(np.arange(0.0, 1e6, 0.05).tolist())

    def fifty() -> None:
        for _ in range(50):
            u, y = next(given)
            watcher.add(next(time), u, y)

    benchmark.pedantic(fifty, rounds=200, warmup_rounds=5)
    each = benchmark.stats.stats.min / 50 * 1e6
    print(f"{each:.1f} us a sample")
    assert each <= 50.0
