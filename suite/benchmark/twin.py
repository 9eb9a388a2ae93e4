"""Twin experiments: Kalman filters on Lorenz-63 with a perfect model, beside published errors.

Sakov, Oliver and Bertino (2012), Table 1, in the setting of DAPPER (Raanes and others, mods/Lorenz63/sakov2012.py): all
three states read every 0.25 time units with variance 2, first state of variance 2 around the given one, 1000 readings,
error of the updated mean (root mean square over the states, then mean over time) after 16 time units.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines._filterpy import extended
from baselines.enkf import ensemble
from suite import plugins
from suite.benchmark.table import to_json
from suite.files import writable_folder, write_whole
from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

SOURCE = "Sakov, Oliver and Bertino (2012), Table 1, as listed by DAPPER, mods/Lorenz63/sakov2012.py"
PERIOD, VARIANCE, BURN_IN, READINGS = 0.25, 2.0, 16.0, 1000


@dataclass(frozen=True)
class Method:
    """A filter of the table: what it is and its published error; `run` gives the updated means, (N, 3)."""

    sentence: str
    published: float
    run: Callable[[Model, Record, Prior, int], Array]


def transformed(
    model: Model, record: Record, prior: Prior, seed: int, members: int = 10, inflation: float = 1.02
) -> Array:
    """Ensemble transform Kalman filter, symmetric root with random rotations; linear outputs. Bishop and others (2001).

    filterpy has no deterministic ensemble filter, so this one is ours. A member is mean + row of A; with Y = A H' the
    update is mean + A' C Y' R^-1 (y - H mean), C = (Y R^-1 Y' + (N - 1) I)^-1, and A <- sqrt(N - 1) C^1/2 A.
    """
    rng, n, ones = np.random.default_rng(seed), len(model.states), np.ones(members) / np.sqrt(members)
    E = prior.x0 + rng.standard_normal((members, n)) @ np.sqrt(prior.P0)
    H = model.output_jacobian(0.0, prior.x0)
    # Rotations of the anomalies that leave their mean zero turn about the vector of ones.
    basis = np.linalg.qr(np.column_stack([ones, np.eye(members)[:, 1:]]))[0]
    x = np.zeros((len(record), n))
    for k in range(len(record)):
        if k > 0:
            E = np.array([model.step(record.t[k - 1], member, (), record.t[k] - record.t[k - 1]) for member in E])
        x[k] = E.mean(axis=0)
        if np.isnan(record.y[k]).any():
            continue
        A = E - x[k]
        Y = A @ H.T
        values, vectors = np.linalg.eigh(Y / prior.R @ Y.T + (members - 1) * np.eye(members))
        x[k] += A.T @ (vectors / values @ vectors.T) @ (Y / prior.R @ (record.y[k] - H @ x[k]))
        turn = np.eye(members)
        turn[1:, 1:] = np.linalg.qr(rng.standard_normal((members - 1, members - 1)))[0]
        A = basis @ turn @ basis.T @ (vectors * np.sqrt((members - 1) / values) @ vectors.T) @ A
        E = x[k] + inflation * A
    return x


METHODS = {
    "extkf": Method(
        "extended Kalman filter (filterpy), covariance times 180 per time unit",
        0.92,
        lambda model, record, prior, seed: extended(model, record, prior, inflation=180.0).x,
    ),
    "enkf-perturbed-10": Method(
        "ensemble Kalman filter with perturbed readings (filterpy), 10 members, inflation 1.04",
        0.65,
        lambda model, record, prior, seed: ensemble(model, record, prior, members=10, inflation=1.04).x,
    ),
    # filterpy's perturbations do not add up to zero, DAPPER's do. In three runs, ten members needed more inflation;
    # whether that is the cause was not tested.
    "enkf-perturbed-10-inflated": Method(
        "ensemble Kalman filter with perturbed readings (filterpy), 10 members, inflation 1.2, "
        "the best of 1.04, 1.1, 1.2 and 1.3 on runs 0 to 2 (published: 1.04)",
        0.65,
        lambda model, record, prior, seed: ensemble(model, record, prior, members=10, inflation=1.2).x,
    ),
    "enkf-perturbed-100": Method(
        "ensemble Kalman filter with perturbed readings (filterpy), 100 members, inflation 1.01",
        0.56,
        lambda model, record, prior, seed: ensemble(model, record, prior, members=100, inflation=1.01).x,
    ),
    "enkf-sqrt-10": Method(
        "ensemble transform Kalman filter (ours: filterpy has none), 10 members, inflation 1.02, random rotations",
        0.60,
        transformed,
    ),
}


def experiment(seed: int, count: int = READINGS) -> tuple[Model, Record, Prior, Array]:
    """The model, the record of `count` readings after a first sample without one, the prior, and the truth (N, 3)."""
    case = plugins.cases()["lorenz-twin"]
    assert case.truth is not None
    assert case.experiment is not None
    model, rng, mean = case.truth, np.random.default_rng(seed), np.array(case.experiment.x0)
    x = np.zeros((count + 1, 3))
    x[0] = mean + np.sqrt(VARIANCE) * rng.standard_normal(3)
    for k in range(count):
        x[k + 1] = model.step(k * PERIOD, x[k], (), PERIOD)
    y = x + np.sqrt(VARIANCE) * rng.standard_normal(x.shape)
    y[0] = np.nan
    t: Array = np.arange(count + 1, dtype=np.float64) * PERIOD
    record = Record(t, np.zeros((count + 1, 0)), y, source=f"{case.name}, seed {seed}")
    return model, record, Prior(mean, VARIANCE * np.eye(3), np.full(3, VARIANCE), np.zeros(3)), x


def error(name: str, seed: int, count: int = READINGS) -> float:
    """The time-averaged error of the updated mean of one method in one run."""
    model, record, prior, truth = experiment(seed, count)
    x = METHODS[name].run(model, record, prior, seed)
    late = record.t > BURN_IN
    return float(np.sqrt(np.mean((x - truth) ** 2, axis=1))[late].mean())


def write(path: Path, seeds: int = 20, say: Callable[[str], None] = lambda text: None) -> dict[str, Any]:
    """All methods over several runs, into a JSON file: the error of each run, with the date."""
    writable_folder(path.parent)
    runs: dict[str, list[float]] = {}
    for name in METHODS:
        runs[name] = [error(name, seed) for seed in range(seeds)]
        say(f"{name}: {np.mean(runs[name]):.3f} +- {np.std(runs[name]) / np.sqrt(seeds):.3f}")
    made = {"schema": 1, "date": datetime.date.today().isoformat(), "readings": READINGS, "errors": runs}
    write_whole(path, to_json(made) + "\n")
    return made
