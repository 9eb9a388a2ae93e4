"""The contract of a case: a plant, the deficient model of it, the experiment, and the conditions it is judged under."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from suite.kernels.trajectory import plant_workspace, trajectory
from suite.model import Model, Parameter
from suite.record import Record

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Missing:
    """A removed effect: its id, the equation it acted in (a state, an output or an input) and its coefficients."""

    effect: str
    equation: str
    coefficients: Mapping[str, float]


@dataclass(frozen=True)
class Experiment:
    """How the plant is run: seconds, sampling step, the true plant's first state and the inputs as functions of time.

    `every` names outputs that are seen only at each k-th sample, from sample k on; NaN between.
    """

    duration: float
    dt: float
    x0: tuple[float, ...]
    inputs: Mapping[str, Callable[[float], float]] = field(default_factory=dict)
    every: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Truth:
    """What only the judge sees: x (N, n) of the deficient model's states, d (N, n) the true model error in rate units,
    noise (outputs,) the standard deviation of the sensors.
    """

    x: Array
    d: Array
    noise: Array


@dataclass(frozen=True)
class Held:
    """A measured record that is judged and never fitted: its unknown first state is fitted to its first `lead` samples
    (None: to all of them), with all parameters fixed, and the error of the free run counts from sample `first` on.
    """

    record: Record
    lead: int | None = None
    first: int = 0


@dataclass(frozen=True)
class Case:
    """A plant whose model lacks something (or nothing: a null case).

    Simulated: `truth` and `experiment` are given; noise is a fraction of each output's standard deviation;
    `held` freezes the model error over each sample (the sampled plant of discrete-time methods). The truth has every
    state of the deficient model, by name, and may have more; its outputs and inputs are the deficient model's.
    Measured: `measured` reads the runs that are fitted, raising DataError with the way to get them where they are not
    there; `held_out` those that are judged, by name; `truth` is None.
    `tags` sort the cases: "mechanical", "thermal", "published", "null" (nothing is missing), "large" ...
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
    held_out: Callable[[Path | None], Mapping[str, Held]] | None = None
    tags: tuple[str, ...] = ()

    def simulate(self, noise: float, seed: int) -> tuple[Record, Truth]:
        """The record of one experiment and its truth; `noise` is the fraction, `seed` fixes every random number."""
        if self.truth is None or self.experiment is None:
            raise ValueError(f"{self.name} is measured; it has no truth to simulate")
        experiment = self.experiment
        t: Array = np.arange(round(experiment.duration / experiment.dt) + 1, dtype=np.float64) * experiment.dt
        u = np.array([[experiment.inputs[name](time) for name in self.deficient.inputs] for time in t])
        u = u.reshape(len(t), len(self.deficient.inputs))
        x, d, clean = self.run(t, u)
        spread = noise * clean.std(axis=0)
        y = clean + spread * np.random.default_rng(seed).standard_normal(clean.shape)
        for name, k in experiment.every.items():
            unseen = np.arange(len(t)) % k != 0
            unseen[0] = True
            y[unseen, list(self.deficient.outputs).index(name)] = np.nan
        record = Record(t, u, y, names=tuple(self.deficient.outputs), source=self.name)
        return record, Truth(np.ascontiguousarray(x[:, self.shared]), d, spread)

    @property
    def shared(self) -> npt.NDArray[np.int64]:
        """Where the deficient model's states stand among the truth's."""
        assert self.truth is not None
        places = {name: i for i, name in enumerate(self.truth.states)}
        return np.array([places[name] for name in self.deficient.states], dtype=np.int64)

    def run(self, t: Array, u: Array) -> tuple[Array, Array, Array]:
        """All states of the plant, (N, n), the model error, (N, m), and the noise-free outputs at the samples.

        The plant is integrated 20 times finer.
        """
        assert self.truth is not None
        assert self.experiment is not None
        # A held case is the deficient model with a push in each rate that is renewed at every sample.
        mover = _pushed(self.deficient) if self.held else self.truth
        n, m = len(self.truth.states), len(self.deficient.states)
        X, D, Y = (np.zeros((len(t), width)) for width in (n, m, len(self.truth.outputs)))
        X[0] = self.experiment.x0
        models = (self.truth, self.deficient, mover)
        pairs = [part for model in models for part in (model.program.rate, model.values)]
        none, inputs = np.zeros(0, dtype=np.int64), u.shape[1]
        work = plant_workspace(n, inputs, max(len(self.truth.parameters), len(mover.parameters)))
        part = plant_workspace(m, inputs, len(self.deficient.parameters))
        slopes = np.zeros((Y.shape[1], n)), np.zeros((Y.shape[1], len(self.truth.parameters)))
        held, linear, sensors = int(self.held), mover.linear_inputs, self.truth.program.output
        trajectory(sensors, *pairs, held, self.shared, t, u, linear, none, X, D, Y, *slopes, work, part)
        return X, D, Y


def _pushed(model: Model) -> Model:
    """The model with a constant push in each rate: the last parameters, push_<state>, at zero."""
    for name in tuple(model.states):
        model = model.plus(name, f"+push_{name}", {f"push_{name}": Parameter(0.0, fixed=True)})
    return model
