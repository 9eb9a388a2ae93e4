"""A sample of the watcher, with three filters and the alarm, costs at most 50 microseconds.

So does one of the estimator that works the same way in a batch.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle
from types import SimpleNamespace
from typing import Any

import numpy as np

from estimators.ie_least_squares import InvariantEmbeddingLeastSquares
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
MOST = 50e-6  # s a sample


def test_a_sample_of_the_watcher(ratio: Any) -> None:
    """Four, five and five states with an effect watched: the least time of 200 rounds of 50 samples, per sample."""
    record, _ = Case("watch", "", SPRING, SPRING, Experiment(60.0, 0.05, (0.0, 0.0))).simulate(0.05, 1)
    watcher = Watcher(SPRING, record.part(0, 40), CUBIC, ["a"])
    given, time = cycle(zip(record.u, record.y, strict=True)), iter(np.arange(0.0, 1e6, 0.05).tolist())

    def fifty() -> None:
        for _ in range(50):
            u, y = next(given)
            watcher.add(next(time), u, y)

    ratio.alone("a sample of the watcher, three filters", fifty, unit="sample", at_most=MOST, per=50, rounds=200)


def test_a_sample_of_recursive_least_squares(plants: SimpleNamespace, ratio: Any) -> None:
    """`ie-least-squares` over 801 samples of both states, with the terms that it chooses itself."""
    plant = plants.paper()
    record, estimator = replace(plant.record, prior=plant.prior), InvariantEmbeddingLeastSquares()
    ratio.alone(
        "a sample of ie-least-squares, in a batch", lambda: estimator.estimate(plant.model, record), unit="sample",
        at_most=MOST, per=len(record), rounds=20,
    )  # fmt: skip
