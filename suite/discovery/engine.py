"""The engine: one record, one model with all its candidates as gated terms, and one pass for any subset of them.

theta = (free initial states of every run, free parameters, parameters of the active candidates). The criterion is
L = n ln(mean e^2) + sum ln s + sum ((p - p0)/sd)^2, with the noise's common scale profiled out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from suite.discovery.library import Term, gates
from suite.discovery.noise import QUIETEST, spans
from suite.errors import DataError
from suite.kernels import codegen
from suite.kernels.integrate import workspace
from suite.kernels.prediction import prediction_errors
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Point:
    """Where a hypothesis stands: x0 (runs, n) and p (all parameters, the candidates' among them)."""

    x0: Array
    p: Array


@dataclass(frozen=True)
class Pass:
    """One pass: e (M,) errors in noise units, J (M, theta), logs = sum ln s, Y (N, outputs), X (N, n)."""

    e: Array
    J: Array
    logs: float
    Y: Array
    X: Array
    finite: bool


@dataclass(frozen=True, eq=False)
class Problem:
    """A record beside a model and its candidates. R (outputs,) is the noise variance of a sample before scaling."""

    model: Model
    record: Record
    terms: tuple[Term, ...]
    R: Array
    start: Point
    free_x0: npt.NDArray[np.bool_]
    weights: Array = field(default_factory=lambda: np.zeros(0))
    path: Array = field(default_factory=lambda: np.zeros((1, 0)))
    substeps: int = 1
    frozen: bool = False  # fits move initial states only
    scale: float | None = None  # the noise's variance in units of R, where it is known and not profiled

    @cached_property
    def _extension(self) -> tuple[tuple[str, ...], tuple[codegen.Gate, ...]]:
        return gates(self.model, self.terms)

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters: the model's, then the candidates'."""
        return (*self.model.parameters, *self._extension[0])

    @cached_property
    def program(self) -> codegen.Program:
        if not self.terms:
            return self.model.program
        return codegen.compile_program(
            states=tuple(self.model.states),
            inputs=tuple(self.model.inputs),
            parameters=self.names,
            rates=self.model.rates,
            outputs=self.model.output_expressions,
            gates=self._extension[1],
        )

    @cached_property
    def seen(self) -> npt.NDArray[np.bool_]:
        """Which measurements are there, (N, outputs)."""
        return ~np.isnan(self.record.y)

    @property
    def count(self) -> int:
        """How many measurements there are."""
        return int(self.seen.sum())

    @cached_property
    def prior(self) -> tuple[Array, Array]:
        """Prior mean and standard deviation of all parameters; infinite for the candidates'."""
        sds = [parameter.prior_sd for parameter in self.model.parameters.values()]
        extra = len(self.names) - len(sds)
        return self.start.p.copy(), np.array(sds + [np.inf] * extra)

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Bounds of all parameters: the file's, the sign of a loss, the range of an inner scale."""
        low = [p.bounds[0] for p in self.model.parameters.values()]
        high = [p.bounds[1] for p in self.model.parameters.values()]
        spread, length = self.spread, self.length
        for term in self.terms:
            low += [0.0 if term.effect.sign else -np.inf] * len(term.coefficients)
            high += [np.inf] * len(term.coefficients)
            for name, inner in term.inner.items():
                unit = term.scale(name, spread, length)
                low.append(inner.low * unit)
                nyquist = np.pi / self.step
                high.append(min(inner.high * unit, nyquist) if inner.of == "frequency" else inner.high * unit)
        return np.array(low), np.array(high)

    @cached_property
    def spread(self) -> dict[str, float]:
        """The visited range of every state: of its output where it is measured, else of the path at the start."""
        ranges = {}
        for i, name in enumerate(self.model.states):
            ranges[name] = float(np.ptp(self.path[:, i])) or 1.0
        return ranges

    @property
    def length(self) -> float:
        """The longest run, in units of time."""
        return max(float(run.t[-1] - run.t[0]) for run in self.record.runs)

    @cached_property
    def step(self) -> float:
        """The median step of the first run."""
        return float(np.median(self.record.runs[0].dt))

    def columns(self, active: Sequence[int]) -> Index:
        """Indices of the parameters that a fit with these candidates moves."""
        if self.frozen:
            return np.zeros(0, dtype=np.int64)
        base = len(self.model.parameters)
        sds = self.prior[1][:base]
        chosen = [j for j in range(base) if sds[j] > 0]
        for k in active:
            chosen += self.places(k)
        return np.array(chosen, dtype=np.int64)

    def places(self, k: int) -> list[int]:
        """Indices of candidate k's parameters."""
        at = len(self.model.parameters) + sum(len(term.names) for term in self.terms[:k])
        return list(range(at, at + len(self.terms[k].names)))

    def run(self, point: Point, q: float, active: Sequence[int] = (), columns: Index | None = None) -> Pass:
        """One pass at process-noise level q, with the given candidates on.

        J's columns: the free initial states of run 0, 1, ..., then `columns` (default: what a fit would move).
        """
        program, record = self.program, self.record
        moved = self.columns(active) if columns is None else columns
        on = program.all_off()
        on[list(active)] = 1
        N, ny = record.y.shape
        n, m = program.n, len(moved)
        e, s, Y = np.zeros((N, ny)), np.ones((N, ny)), np.zeros((N, ny))
        X, J = np.zeros((N, n)), np.zeros((N, ny, n + m))
        wide = (n, n + m)
        scratch = (
            np.zeros(n), np.zeros(ny), np.zeros((ny, n)), np.zeros((ny, program.parameters)),
            np.zeros((n, n)), np.zeros((n, n)), np.zeros(wide), np.zeros(wide), np.zeros(wide), np.zeros(n),
        )  # fmt: skip
        Q = q * 10.0 * self.weights**2 * self.step
        failed = prediction_errors(
            program.rate, program.output, record.t, record.u, self.model.linear_inputs, record.y, record.bounds,
            np.ascontiguousarray(point.x0), point.p, on, moved, Q, self.R, self.angles, self.substeps,
            workspace(n, program.inputs, program.parameters, m), scratch, e, s, J, X, Y,
        )  # fmt: skip
        seen = self.seen
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = float(np.log(s[seen]).sum())
        finite = failed < 0 and bool(np.isfinite(e).all())
        return Pass(e[seen], self._scatter(J), logs, self._turned(Y), X, finite)

    def _turned(self, Y: Array) -> Array:
        """Simulated angles in the turn of their measurement."""
        for j in np.flatnonzero(self.angles):
            rows = self.seen[:, j] & np.isfinite(Y[:, j])
            turns = np.round((self.record.y[rows, j] - Y[rows, j]) / (2.0 * np.pi))
            Y[rows, j] += 2.0 * np.pi * turns
        return Y

    @cached_property
    def angles(self) -> Array:
        return np.array([float(output.angle) for output in self.model.outputs.values()])

    def _scatter(self, J: Array) -> Array:
        """Each run's own initial-state columns at their place in theta; rows of missing samples left out."""
        n = self.program.n
        free = np.flatnonzero(self.free_x0)
        runs = len(self.record.starts)
        if runs == 1:
            keep = np.concatenate([free, np.arange(n, J.shape[2])])
            return J[self.seen][:, keep]
        wide = np.zeros((*J.shape[:2], runs * len(free) + J.shape[2] - n))
        bounds = self.record.bounds
        for r in range(runs):
            rows = slice(bounds[r], bounds[r + 1])
            wide[rows, :, r * len(free) : (r + 1) * len(free)] = J[rows][:, :, free]
        wide[:, :, runs * len(free) :] = J[:, :, n:]
        return wide[self.seen]

    def cost(self, passed: Pass, point: Point, columns: Index) -> float:
        """L of a pass: n ln(mean e^2) + sum ln s + prior."""
        if not passed.finite:
            return np.inf
        mean, sd = self.prior
        with np.errstate(invalid="ignore"):
            pulls = ((point.p - mean) / sd)[columns]
        pull = float((pulls[np.isfinite(sd[columns])] ** 2).sum())
        if self.scale is not None:
            return float((passed.e**2).sum()) / self.scale + passed.logs + pull
        return float(len(passed.e) * np.log(self.noise(passed)) + passed.logs + pull)

    def noise(self, passed: Pass) -> float:
        """The noise's variance in units of R: given, or the mean squared error."""
        return self.scale if self.scale is not None else max(float(np.mean(passed.e**2)), self.quietest)

    @cached_property
    def quietest(self) -> float:
        """The noise's variance in units of R below which the integrator makes the error: noise-free data must not
        drive the criterion to minus infinity.
        """
        floor = float(np.min((QUIETEST * spans(self.record)) ** 2 / self.R))
        return min(max(floor, 1e-12), 1.0)

    def pack(self, point: Point, columns: Index) -> Array:
        """Theta of a point."""
        return np.concatenate([point.x0[:, self.free_x0].ravel(), point.p[columns]])

    def unpack(self, theta: Array, point: Point, columns: Index) -> Point:
        """The point with theta in place, within bounds."""
        runs, free = len(point.x0), int(self.free_x0.sum())
        x0, p = point.x0.copy(), point.p.copy()
        x0[:, self.free_x0] = theta[: runs * free].reshape(runs, free)
        low, high = self.limits
        p[columns] = np.clip(theta[runs * free :], low[columns], high[columns])
        return Point(x0, p)

    def on(self, record: Record, start: Point, R: Array | None = None) -> Problem:
        """The same hypotheses beside another record."""
        return replace(self, record=record, start=start, R=self.R if R is None else R)


def check_record(model: Model, record: Record) -> None:
    """Raise DataError where a record cannot be used with a model."""
    if record.y.shape[1] != len(model.outputs) or record.u.shape[1] != len(model.inputs):
        raise DataError(
            f"{record.source}: expected {len(model.outputs)} outputs and {len(model.inputs)} inputs as in the model, "
            f"got {record.y.shape[1]} and {record.u.shape[1]}; read it with this model"
        )
    unknown = sum(p.prior_sd > 0 for p in model.parameters.values())
    open_states = [s for s in model.states if s not in model.initial or model.initial[s].estimate]
    first = len(open_states) * len(record.starts)
    count = int((~np.isnan(record.y)).sum())
    if count < unknown + first + 2:
        raise DataError(
            f"{record.source}: {count} measurements cannot determine {unknown} parameters and {first} initial states; "
            "add data or fix parameters"
        )
