"""The sources' Table 1 by a declared reconstruction, and how its numbers move with each thing the source leaves open.

Raol and others (2016), equations (100)-(101), Table 1. It prints a3 and J of the generalized and of the conventional
estimator; it does not state x0, the noise, H, Q, R, S0, alpha or the definition of J. Hundreds of settings reach both
a3, dozens both J as well: the one used here is a reconstruction, one of many.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from suite import plugins
from suite.benchmark.table import grid
from suite.case import Case, Truth
from suite.estimator import Estimate
from suite.model import Initial, Model
from suite.prior import default_prior
from suite.record import Record

Array = npt.NDArray[np.float64]

TRUE_A3 = 0.0195
PUBLISHED = {
    ("generalized", "a3"): 0.0188,
    ("generalized", "J"): 0.00016722,
    ("conventional", "a3"): 0.0182,
    ("conventional", "J"): 0.0012,
}


@dataclass(frozen=True)
class Setting:
    """All that Table 1 depends on. Q and S0 are diagonals (n,), R the spectral density of each measured state."""

    alpha: float = 0.1375
    Q: tuple[float, float] = (0.004, 0.4)
    R: float = 1.0
    S0: float = 50.0
    x0: tuple[float, float] = (0.0, 0.0)
    measured: tuple[str, ...] = ("x1",)
    noise: float = 0.0
    estimator: str = "generalized-ie"
    held: bool = False
    cost: str = "mean over time, both parts"

    @property
    def sentence(self) -> str:
        """The setting in words."""
        return (
            f"x0 = {self.x0}, noise {self.noise:g}, {' and '.join(self.measured)} measured, Q = diag{self.Q}, "
            f"R = {self.R:g}, S0 = {self.S0:g} I, alpha = {self.alpha:g} (generalized) and 1 (conventional), "
            f"{self.estimator}, z {'held' if self.held else 'linear'} between samples, J: {self.cost}"
        )


COSTS: dict[str, Callable[[float, float, float], float]] = {
    "mean over time, both parts": lambda data, model, T: data + model,
    "integral over time, both parts": lambda data, model, T: (data + model) * T,
    "mean over time, the data part": lambda data, model, T: data,
    "mean over time, the model part": lambda data, model, T: model,
}

# One thing at a time, away from the reconstruction.
OPEN: tuple[tuple[str, Setting], ...] = (
    ("x0 of plant and filter: (1, 1)", Setting(x0=(1.0, 1.0))),
    ("noise: 1 % of each sd", Setting(noise=0.01)),
    ("noise: 5 % of each sd", Setting(noise=0.05)),
    ("measured: x1 and x2", Setting(measured=("x1", "x2"))),
    ("measured: x2", Setting(measured=("x2",))),
    ("Q: ten times larger", Setting(Q=(0.04, 4.0))),
    ("Q: 0.004 I", Setting(Q=(0.004, 0.004))),
    ("R: 0.1", Setting(R=0.1)),
    ("R: 10", Setting(R=10.0)),
    ("S0: 0.5 I", Setting(S0=0.5)),
    ("S0: 5 I", Setting(S0=5.0)),
    ("S0: 500 I", Setting(S0=500.0)),
    ("alpha (generalized): 0.05", Setting(alpha=0.05)),
    ("alpha (generalized): 0.5", Setting(alpha=0.5)),
    ("between samples: z held", Setting(held=True)),
    ("method: the discrete filter", Setting(estimator="generalized-ie-discrete")),
    *((f"J: {name}", Setting(cost=name)) for name in list(COSTS)[1:]),
)


def solve(setting: Setting, alpha: float) -> tuple[Record, Truth, Estimate]:
    """The record of x0 and noise as set, its truth, and what the estimator makes of it."""
    case: Case = plugins.cases()["paper-cubic"]
    assert case.experiment is not None
    dt = case.experiment.dt
    case = replace(case, experiment=replace(case.experiment, x0=setting.x0))
    record, truth = case.simulate(setting.noise, seed=0)
    columns = [list(case.deficient.outputs).index(name) for name in setting.measured]
    model = measuring(case.deficient, setting.measured)
    initial = {name: Initial(x) for name, x in zip(model.states, setting.x0, strict=True)}
    model = replace(model, initial=initial)
    record = replace(record, y=record.y[:, columns].copy())
    given = _held(record) if setting.held else record
    given = given.with_prior(default_prior(model, record, truth.noise[columns]))
    # The discrete filter takes the variance of a sample, which is the spectral density over the step.
    step = dt if setting.estimator.endswith("-discrete") else 1.0
    Q, R, S0 = np.array(setting.Q), np.full(len(columns), setting.R / step), setting.S0 * np.eye(2)
    estimate = plugins.estimators()[setting.estimator].estimate(model, given, alpha=alpha, Q=Q, R=R, S0=S0)
    if setting.held:
        assert estimate.d is not None
        # The innovation jumps where a new sample comes and decays while it is held: take the mean over each hold.
        x, d = (_hold_means(values) for values in (estimate.x, estimate.d))
        estimate = replace(estimate, x=x, d=d, P=None)
    return record, truth, estimate


def measuring(model: Model, names: tuple[str, ...]) -> Model:
    """The model with only the named outputs."""
    return replace(model, outputs={name: model.outputs[name] for name in names})


# Points of a hold, as shares of the step: the last lies just before the next sample.
HOLD = np.append(np.arange(8) / 8.0, 0.999)


def _held(record: Record) -> Record:
    """Every sample but the last repeated over its step: a line between samples then holds the value."""
    t = (record.t[:-1, None] + HOLD * record.dt[:, None]).ravel()
    y, u = (np.repeat(values[:-1], len(HOLD), axis=0) for values in (record.y, record.u))
    return replace(record, t=t, y=y, u=u)


def _hold_means(values: Array) -> Array:
    """(holds * points, n) -> (holds, n), the mean over each hold by the trapezoidal rule."""
    parts = values.reshape(-1, len(HOLD), values.shape[1])
    return np.asarray(np.trapezoid(parts, HOLD, axis=1) / HOLD[-1])


def regress(estimate: Estimate) -> float:
    """a3 by least squares of dhat1 = -a3 xhat2^3, no sample dropped."""
    assert estimate.d is not None
    cube = -(estimate.x[:, 1] ** 3)
    return float(cube @ estimate.d[:, 0] / (cube @ cube))


@cache
def numbers(setting: Setting) -> dict[tuple[str, str], float]:
    """The four numbers of Table 1 under a setting."""
    found = {}
    for name, alpha in (("generalized", setting.alpha), ("conventional", 1.0)):
        record, _, estimate = solve(setting, alpha)
        assert estimate.J is not None
        found[name, "a3"] = regress(estimate)
        found[name, "J"] = COSTS[setting.cost](*estimate.J, float(record.t[-1] - record.t[0]))
    return found


HEADING = ["setting", "a3 generalized", "J generalized", "a3 conventional", "J conventional"]


def cells() -> list[list[str]]:
    """Published, reconstructed, and each open point moved alone, as rows of text under HEADING."""

    def row(label: str, values: dict[tuple[str, str], float]) -> list[str]:
        return [label, *(f"{values[key]:.5g}" for key in PUBLISHED)]

    rows = [
        HEADING,
        row("published (true a3: 0.0195)", PUBLISHED),
        row("reconstruction, one of many", numbers(Setting())),
    ]
    return rows + [row(label, numbers(setting)) for label, setting in OPEN]


def open_text() -> str:
    """What the source does not state, and how the numbers move with each."""
    opening = (
        "The source does not state x0, the noise, what is measured (H), Q, R, S0, alpha, what z does between samples\n"
        f"or the definition of J. The reconstruction: {Setting().sentence}.\nMoved one at a time:\n\n"
    )
    return opening + grid(cells())
