"""The same arithmetic against C written by hand for one plant (peer.c), compiled here with -O3 -march=native.

The C knows two states, two outputs and the equations; ours learned them from a text. It gives states and covariances;
ours also keeps what a smoother needs. Compile times are outside.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np

from suite.case import Case, Experiment
from suite.discovery.fit import prepare
from suite.filtering import filtered

RUNS, LENGTH = 10_000, 101  # of the batch: 5 s at 0.05 s
CORES = 2


def test_the_filter_takes_three_times_that_of_c(
    plants: SimpleNamespace, ratio: Any, by_hand: Callable[..., Any], paper_arrays: Callable[..., Any]
) -> None:
    """One pass over 801 samples, n = 2, one thread each; the numbers agree to 1e-12."""
    plant = plants.paper()
    record, prior = plant.record, plant.prior
    X, P = np.zeros((len(record), 2)), np.zeros((len(record), 2, 2))
    theirs = by_hand("ekf", len(record), *paper_arrays(plant, record), prior.Q, prior.R, prior.x0, prior.P0, X, P)
    theirs()

    def ours() -> Any:
        return filtered(plant.model, record, prior.x0, prior.P0, prior.Q, prior.R)

    np.testing.assert_allclose(ours().x, X, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(ours().P, P, rtol=0.0, atol=1e-12)
    ratio(
        "extended Kalman filter, n = 2", ours, "C by hand", theirs, unit="step", per=len(record), at_most=3.0,
        rounds=200, turns=100,
    )  # fmt: skip


def test_a_batch_of_runs_takes_ten_times_a_step_of_c(
    plants: SimpleNamespace, ratio: Any, by_hand: Callable[..., Any], paper_arrays: Callable[..., Any]
) -> None:
    """Ten thousand records of 101 samples: two threads, as kernels release the interpreter's lock, against one of C.

    The processor time of both threads together, of which the wait is half where both cores are free.
    """
    plant = plants.paper()
    model, prior = plant.model, plant.prior
    case = Case("speed", "", model, model, Experiment(5.0, 0.05, (0.0, 0.0)))
    records = [case.simulate(0.05, seed)[0] for seed in range(100)] * (RUNS // 100)
    X, P = np.zeros((LENGTH, 2)), np.zeros((LENGTH, 2, 2))
    calls = [
        by_hand("ekf", LENGTH, *paper_arrays(plant, record), prior.Q, prior.R, prior.x0, prior.P0, X, P)
        for record in records[:100]
    ]  # fmt: skip
    assert len(records[0]) == LENGTH

    def share(part: Any) -> float:
        """The last states' sum over a part of the records: all that a study of many runs keeps of each."""
        return sum(float(filtered(model, r, prior.x0, prior.P0, prior.Q, prior.R).x[-1, 0]) for r in part)

    def ours() -> float:
        with ThreadPoolExecutor(CORES) as pool:
            return sum(pool.map(share, (records[i::CORES] for i in range(CORES))))

    def theirs() -> None:
        for call in calls:
            call()

    ratio(
        f"batch of {RUNS} runs of {LENGTH} samples, n = 2, two threads", ours, "C by hand, one thread",
        lambda: [theirs() for _ in range(RUNS // 100)], unit="step", per=RUNS * LENGTH, at_most=10.0, rounds=2, turns=2,
    )  # fmt: skip


def test_errors_with_sensitivities_take_five_times_that_of_c(
    plants: SimpleNamespace, ratio: Any, by_hand: Callable[..., Any], paper_arrays: Callable[..., Any]
) -> None:
    """The errors of a simulation over 801 samples and their slopes by two first states and three parameters."""
    plant = plants.paper(estimated=True)
    problem = prepare(plant.model, plant.record)
    assert problem.substeps == 1
    steps, start = len(plant.record), problem.start
    sigma, x0 = np.sqrt(problem.R), start.x0[0].copy()
    e, J = np.zeros((steps, 2)), np.zeros((steps, 2, 5))
    theirs = by_hand("output_errors", steps, *paper_arrays(plant, plant.record), sigma, x0, e, J)
    theirs()
    found = problem.run(start, 0.0)
    np.testing.assert_allclose(found.e, e.ravel(), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.J, J.reshape(-1, 5), rtol=0.0, atol=1e-7)
    ratio(
        "prediction-error pass with 5 sensitivities, n = 2", lambda: problem.run(start, 0.0), "C by hand", theirs,
        unit="step", per=steps, at_most=5.0, rounds=200, turns=100,
    )  # fmt: skip
