"""Watching a plant while it runs: what each sample says of the model, of its error, and of a suspected effect.

Three filters take each sample. The model's own, in which nothing but its uncertain parameters may be wrong, gives the
innovations and, by their sequential test, the alarm. One with a random-walk disturbance in each suspected equation
gives d. One with the suspected effect added gives its coefficients, by recursive least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from suite.alarm import Alarm
from suite.discovery.noise import noise_variance
from suite.disturbance import CHANGES, SHARE
from suite.errors import DataError
from suite.following import follow, uncertain
from suite.kernels.watch import watched
from suite.least_squares import MEMORY, LeastSquares
from suite.model import Model
from suite.prior import default_prior
from suite.record import Prior, Record
from suite.streaming import Filter

Array = npt.NDArray[np.float64]

FALSE_ALARMS = 1e-5  # a sample


class Reading(NamedTuple):
    """What is known after a sample. Standard deviations are those of the filters, in the unit of their number.

    innovation (outputs,) over its sd, NaN where not measured; d, d_sd (suspects,) in rate units; coefficients,
    coefficients_sd (coefficients of the effect,); statistic: 1 raises the alarm; since: the time from which on the
    model has failed, or None; lost: a filter whose numbers left every bound and stand still.
    """

    t: float
    innovation: Array
    d: Array
    d_sd: Array
    coefficients: Array
    coefficients_sd: Array
    statistic: float
    since: float | None
    lost: bool


class Watcher:
    """The filters and the test for one model, set up on a first stretch of data, which they then take first.

    `first`: one run with the first samples; it tells the sensors' noise where the model does not, the first state, and
    how large a model error may be. `effect`: the model with a suspected effect added, and `coefficients` the names of
    its parameters to follow. `exact`: the model's parameters are as given. `memory`: how long the past counts (time;
    default MEMORY samples): coefficients forget, and d may change by its own size over it. `rate`: false alarms a
    sample. Raises DataError.
    """

    def __init__(
        self, model: Model, first: Record, effect: Model | None = None, coefficients: Sequence[str] = (),
        *, exact: bool = False, memory: float | None = None, rate: float = FALSE_ALARMS,
    ) -> None:  # fmt: skip
        self.model, self.coefficients = model, tuple(coefficients)
        prior = first_prior(model, first)
        own = {} if exact else uncertain(model)
        self._n = len(model.states)
        path = _path(Filter(*follow(model, prior, own)), first)[:, : self._n]
        memory = MEMORY * float(np.median(first.dt)) if memory is None else memory
        rates = [model.rate(t, x, u) for t, x, u in zip(first.t, path, first.u, strict=True)]
        size = np.sqrt(np.mean(np.square(rates), axis=0))
        if not np.all(np.isfinite(size)):
            raise DataError(f"{first.source}: the model leaves every bound on the first {len(first)} samples; refit it")
        null, error = Filter(*follow(model, prior, own)), Filter(*follow(*_disturbed(model, prior, size, memory), own))
        m, suspects, count = len(model.outputs), len(model.suspects), len(self.coefficients) if effect else 0
        if effect is not None:
            sds = _plausible(effect, self.coefficients, first, path, size)
            squares = LeastSquares(effect, prior, sds, own, memory, m)
            followed, fit = squares.filter, squares.fit
        else:
            # No coefficient is followed, so the kernel looks at neither.
            followed, fit = null, np.zeros(0)
        alarm, fits = Alarm(rate, m), Alarm(FALSE_ALARMS, m)
        ends = np.cumsum([m, suspects, suspects, count, count, 3]).tolist()
        self._out = np.zeros(ends[-1])
        self._cuts = [slice(*ends[i : i + 2]) for i in range(4)]
        self._innovation = slice(0, m)
        # What the filters' numbers live in, and the programs that own the addresses in them.
        self._kept = (null, error, followed)
        vectors = [vector for run in self._kept for vector in (run.whole, run.real)]
        self._fixed = (self._n, suspects, count, *vectors, fit, alarm.test, fits.test, self._out)
        self._quiet = len(first)  # samples that still belong to the first stretch

    def add(self, t: float, u: Array, y: Array) -> Reading:
        """Take one sample: time, inputs (inputs,), outputs (outputs,) with NaN where missing. Time must increase."""
        self._quiet -= 1
        watched(t, u, y, self._quiet >= 0, *self._fixed)
        out = self._out.copy()
        statistic, since, lost = out[-3:].tolist()
        d, d_sd, value, sd = self._cuts
        return Reading(
            t, out[self._innovation], out[d], out[d_sd], out[value], out[sd], statistic,
            None if since != since else since, lost > 0.0,
        )  # fmt: skip


def first_prior(model: Model, first: Record) -> Prior:
    """What the first samples say: `default_prior` with no process noise and wide room for states not measured."""
    prior = default_prior(model, first, np.sqrt(noise_variance(model, first)))
    P0 = np.diag(prior.P0).copy()
    direct = {output.equation.strip() for output in model.outputs.values()}
    # A rate that nothing measures may be as large as the outputs' own rates.
    pace = float(np.nanmax(np.abs(np.diff(first.y, axis=0) / first.dt[:, None]), initial=0.0))
    for i, name in enumerate(model.states):
        if P0[i] > 0.0 and name not in direct:
            P0[i] = max(P0[i], pace**2)
    return Prior(prior.x0, np.diag(P0), prior.R, np.zeros_like(prior.Q))


def _path(run: Filter, first: Record) -> Array:
    """The filter's states over the first samples, (N, n)."""
    path = np.zeros((len(first), len(run.x)))
    for k, (t, u, y) in enumerate(zip(first.t, first.u, first.y, strict=True)):
        run.add(t, u, y)
        path[k] = run.x
    return path


def _disturbed(model: Model, prior: Prior, size: Array, memory: float) -> tuple[Model, Prior]:
    """The model with a random walk in each suspected equation: as large as the rate's own `size` (n,) at most."""
    at = [list(model.states).index(name) for name in model.suspects]
    n, m = len(model.states), len(at)
    variance = size[at] ** 2
    P0 = np.zeros((n + m, n + m))
    P0[:n, :n], P0[n:, n:] = prior.P0, np.diag(variance)
    Q = np.concatenate([np.zeros(n), SHARE * variance * CHANGES / memory])
    return model.with_disturbance(model.suspects), Prior(np.concatenate([prior.x0, np.zeros(m)]), P0, prior.R, Q)


def _plausible(effect: Model, names: Sequence[str], first: Record, path: Array, size: Array) -> dict[str, float]:
    """For each coefficient the largest plausible value: with it the effect is as large as what it is added to."""
    n = len(size)
    nothing = Prior(path[0], np.zeros((n, n)), np.ones(1), np.zeros(n))
    probe, _ = follow(effect, nothing, dict.fromkeys(names, 1.0))
    values = np.array([effect.parameters[name].value for name in names])
    spread = np.nanstd(first.y, axis=0)
    scale = np.concatenate([size, spread])
    squares = np.zeros((n + len(spread), len(names)))
    for t, x, u in zip(first.t, path, first.u, strict=True):
        state = np.concatenate([x, values])
        squares[:n] += probe.jacobian(t, state, u)[:n, n:] ** 2 / len(first)
        squares[n:] += probe.output_jacobian(t, state, u)[:, n:] ** 2 / len(first)
    found = {}
    for j, name in enumerate(names):
        acts = squares[:, j] > 0.0
        if not np.any(acts & (scale > 0.0)):
            raise DataError(f"{first.source}: nothing in the first {len(first)} samples shows {name}; read more first")
        found[name] = float(np.max(scale[acts] / np.sqrt(squares[acts, j])))
    return found
