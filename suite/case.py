"""The contract of a case: a plant, the deficient model of it, the experiment, and the conditions it is judged under."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from suite.kernels.integrate import transition
from suite.model import Model
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Missing:
    """A removed effect: its id, the equation it acted in, and its coefficients."""

    effect: str
    equation: str
    coefficients: Mapping[str, float]


@dataclass(frozen=True)
class Experiment:
    """How the plant is run: seconds, sampling step, first state and the inputs as functions of time."""

    duration: float
    dt: float
    x0: tuple[float, ...]
    inputs: Mapping[str, Callable[[float], float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Truth:
    """What only the judge sees: x (N, n) of the deficient model's states, d (N, n) the true model error in rate units,
    noise (outputs,) the standard deviation of the sensors."""

    x: Array
    d: Array
    noise: Array


@dataclass(frozen=True)
class Case:
    """A plant whose model lacks something (or nothing: a null case).

    Simulated: `truth` and `experiment` are given; noise is a fraction of each output's standard deviation;
    `held` freezes the model error over each sample (the sampled plant of discrete-time methods).
    Measured: `measured` reads the runs, raising DataError with the way to get them where they are not there; `truth`
    is None.
    """

    name: str
    sentence: str
    deficient: Model
    truth: Model | None = None
    experiment: Experiment | None = None
    measured: Callable[[Path | None], Record] | None = None
    missing: tuple[Missing, ...] = ()
    noises: tuple[float, ...] = (0.0, 0.01, 0.05, 0.1)
    held: bool = False

    def simulate(self, noise: float, seed: int) -> tuple[Record, Truth]:
        """The record of one experiment and its truth; `noise` is the fraction, `seed` fixes every random number."""
        if self.truth is None or self.experiment is None:
            raise ValueError(f"{self.name} is measured; it has no truth to simulate")
        experiment = self.experiment
        t = np.arange(round(experiment.duration / experiment.dt) + 1) * experiment.dt
        u = np.array([[experiment.inputs[name](time) for name in self.deficient.inputs] for time in t])
        u = u.reshape(len(t), len(self.deficient.inputs))
        x, d = self._run(t, u)
        clean = np.array([self.truth.output(t[k], x[k], u[k]) for k in range(len(t))])
        spread = noise * clean.std(axis=0)
        y = clean + spread * np.random.default_rng(seed).standard_normal(clean.shape)
        return Record(t, u, y, names=tuple(self.deficient.outputs), source=self.name), Truth(x, d, spread)

    def _run(self, t: Array, u: Array) -> tuple[Array, Array]:
        """States and model error at the samples, from the true plant integrated 20 times finer than it is sampled."""
        assert self.truth is not None and self.experiment is not None
        x = np.zeros((len(t), len(self.deficient.states)))
        d = np.zeros_like(x)
        x[0] = self.experiment.x0
        linear = self.truth.linear_inputs
        for k in range(len(t)):
            d[k] = self.truth.rate(t[k], x[k], u[k]) - self.deficient.rate(t[k], x[k], u[k])
            if k + 1 == len(t):
                break
            step = t[k + 1] - t[k]
            if self.held:
                pushed = _pushed(self.deficient, d[k])
                x[k + 1] = transition(pushed.program, t[k], x[k], u[k], u[k + 1], linear, pushed.values, step)[0]
                continue
            state = x[k]
            for i in range(20):
                u0 = u[k] + linear * (i / 20) * (u[k + 1] - u[k])
                u1 = u[k] + linear * ((i + 1) / 20) * (u[k + 1] - u[k])
                state = transition(
                    self.truth.program, t[k] + i * step / 20, state, u0, u1, linear, self.truth.values, step / 20
                )[0]
            x[k + 1] = state
        return x, d


def _pushed(model: Model, d: Array) -> Model:
    """The model with a constant push in each rate: parameters push_<state>."""
    from suite.model import Parameter

    for name, value in zip(tuple(model.states), d, strict=True):
        model = model.plus(name, f"+push_{name}", {f"push_{name}": Parameter(float(value), fixed=True)})
    return model


def default_prior(model: Model, record: Record, noise: Array) -> Prior:
    """The prior every estimator of a benchmark cell starts from, made of the model and the record alone.

    x0: the known initial values, else what the first sample says of a state measured directly, else zero, with
    P0 = 0, R, or the variance of what is measured. R: the noise as given (never below 1e-6 of the output's spread).
    Q: (spread of the measured outputs' rate)^2 times the sampling step, for equations that may be wrong.
    """
    first = record.runs[0]
    seen = ~np.isnan(first.y)
    spread = np.array([np.std(first.y[seen[:, j], j]) for j in range(first.y.shape[1])])
    R = np.maximum(noise, 1e-6 * np.maximum(spread, 1e-300)) ** 2
    n = len(model.states)
    x0, P0 = np.zeros(n), np.zeros(n)
    for i, name in enumerate(model.states):
        given = model.initial.get(name)
        direct = [j for j, output in enumerate(model.outputs.values()) if output.equation.strip() == name]
        if given is not None and not given.estimate:
            x0[i] = given.value
        elif direct and seen[0, direct[0]]:
            x0[i], P0[i] = first.y[0, direct[0]], R[direct[0]]
        else:
            x0[i] = given.value if given is not None else 0.0
            P0[i] = float(np.max(spread**2))
    dt = float(np.median(first.dt))
    pace = max(
        float(np.sqrt(np.nanmean((np.diff(first.y[:, j]) / first.dt) ** 2))) for j in range(first.y.shape[1])
    )
    Q = np.array([pace**2 * dt if name in model.suspects else 0.0 for name in model.states])
    return Prior(x0, np.diag(P0), R, Q)
