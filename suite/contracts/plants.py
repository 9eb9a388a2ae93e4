"""The plants and records that estimators are checked on: small, quick, and each with one difficulty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.case import Case, Experiment
from suite.model import Initial, Input, Model, Output, Parameter
from suite.prior import default_prior
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

# A driven mass on a spring, position and speed measured, all linear.
LINEAR = Model(
    name="driven oscillator",
    states={"p": "v", "v": "F - c*v - k*p"},
    parameters={"c": Parameter(0.3), "k": Parameter(2.0)},
    inputs={"F": Input("F")},
    outputs={"pos": Output("p", "pos"), "speed": Output("v", "speed")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
HARDENING = LINEAR.plus("v", "-a*p**3", {"a": Parameter(1.0)})
CONSTANT = 0.8
PUSHED = LINEAR.plus("v", "+a", {"a": Parameter(CONSTANT)})
POSITION = replace(LINEAR, outputs={"pos": Output("p", "pos")})
DECAY = Model(
    name="decay",
    states={"x": "-b*x"},
    parameters={"b": Parameter(0.5)},
    outputs={"z": Output("x", "z")},
    initial={"x": Initial(2.0, estimate=True)},
)
FASTER = DECAY.plus("x", "-a*x**2", {"a": Parameter(0.2)})


def record(model: Model, truth: Model, seconds: float = 6.0, dt: float = 0.05) -> Record:
    """Measurements of the true plant with 2 % noise, and the prior that the benchmark would give."""
    inputs = {name: lambda t: 2.0 * math.sin(1.5 * t) for name in model.inputs}
    first = tuple(entry.value for entry in truth.initial.values())
    case = Case(model.name, "", model, truth, Experiment(seconds, dt, first, inputs))
    found, judged = case.simulate(0.02, 4)
    return found.with_prior(default_prior(model, found, judged.noise))


def with_values(of: Record, model: Model, y: Array) -> Record:
    """The record with other measurements, and the prior that belongs to these."""
    assert of.prior is not None
    changed = Record(of.t, of.u, y)
    return changed.with_prior(default_prior(model, changed, np.sqrt(of.prior.R)))


def without_samples(of: Record, model: Model) -> Record:
    """A third of the samples, three in a row among them and the last, hold no value."""
    y = of.y.copy()
    y[np.random.default_rng(2).random(len(of)) < 1 / 3] = np.nan
    y[:2] = of.y[:2]
    y[40:43] = y[-1] = np.nan
    return with_values(of, model, y)


def by_channel(of: Record, model: Model) -> Record:
    """Each channel has gaps of its own: the first is seen at odd samples, the second at every fifth."""
    y = of.y.copy()
    for j in range(y.shape[1]):
        seen = np.arange(len(of)) % (2, 5)[j] == (1, 0)[j]
        y[~seen, j] = np.nan
    return with_values(of, model, y)


def irregular(of: Record, model: Model) -> Record:
    """Four samples in ten are not there at all, so that steps differ up to tenfold."""
    kept = np.flatnonzero(np.random.default_rng(3).random(len(of)) < 0.6)
    assert of.prior is not None
    cut = Record(of.t[kept], of.u[kept], of.y[kept])
    return cut.with_prior(default_prior(model, cut, np.sqrt(of.prior.R)))


def short(of: Record, model: Model, samples: int) -> Record:
    """The first samples."""
    assert of.prior is not None
    cut = of.part(0, samples)
    return cut.with_prior(default_prior(model, cut, np.sqrt(of.prior.R)))


def gaussian_prior(model: Model) -> Prior:
    """An uncertain first state, noisy sensors, and white noise in the equations that may be wrong."""
    n = len(model.states)
    Q = np.array([0.5 if name in model.suspects else 0.0 for name in model.states])
    return Prior(np.full(n, 0.5), 0.1 * np.eye(n), np.full(len(model.outputs), 0.02), Q)
