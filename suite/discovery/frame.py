"""The frame of a search: one record, one model with all its candidates as gated terms, and what theta is made of.

theta = (free initial states of every run, free parameters, parameters of the active candidates).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from suite import expressions
from suite.delays import channels
from suite.discovery.terms import Term, gates
from suite.kernels import codegen
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Point:
    """Where a hypothesis stands: x0 (runs, n + the candidates' states) and p (all parameters, the candidates' too)."""

    x0: Array
    p: Array


@dataclass(frozen=True, eq=False)
class Layout:
    """What a set of active candidates makes of theta: switches on (gates,), the states that run (indices into
    Point.x0's columns), which of them are free at the start (positions among those), and the parameters that move.
    """

    active: tuple[int, ...]
    on: Index
    states: Index
    free: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class Frame:
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
    dropped: int = 0  # samples left out as outliers
    rough: Array = field(default_factory=lambda: np.zeros(0))  # (outputs,) the variance that the record itself shows
    colour: Array | None = None  # memory of each output's noise from sample to sample, (outputs,); None: white

    @cached_property
    def _extension(self) -> tuple[tuple[str, ...], tuple[codegen.Gate, ...]]:
        return gates(self.model, self.terms)

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters: the model's, then the candidates'."""
        return (*self.model.parameters, *self._extension[0])

    @cached_property
    def program(self) -> codegen.Program:
        """The compiled model with every term behind a gate, delayed inputs as channels of their own."""
        if not self.terms and not self._late:
            return self.model.program
        inputs, late = list(self.model.inputs), self._late
        extra = [f"{inputs[j]}__{channel}" for j in late for channel in ("late", "slope", "tau")]
        extra += [f"{inputs[j]}__held" for j in self._held]
        act = self._acting
        return codegen.compile_program(
            states=tuple(self.model.states),
            inputs=(*inputs, *extra),
            parameters=self.names,
            rates=[act(rate) for rate in self.model.rates],
            outputs=[act(output) for output in self.model.output_expressions],
            gates=[gate.through(act) for gate in self._extension[1]],
        )

    def label(self, j: int) -> str:
        """What people call parameter j: a candidate's without the number of its gate."""
        return self.names[j].split("__", 1)[-1]

    def _acting(self, expression: codegen.Expr) -> codegen.Expr:
        """The expression with the inputs that the model itself delays as they act."""
        for name, entry in self.model.inputs.items():
            if entry.delay is not None:
                F, late, slope, tau = (expressions.symbol(f"{name}{c}") for c in ("", "__late", "__slope", "__tau"))
                expression = expression.subs(F, late - (expressions.symbol(entry.delay) - tau) * slope)
        return expression

    @cached_property
    def _late(self) -> dict[int, int]:
        """The parameter that each delayed input is delayed by, by the input's number."""
        names = list(self.model.inputs)
        own = {
            j: list(self.model.parameters).index(e.delay) for j, e in enumerate(self.model.inputs.values()) if e.delay
        }
        offered = {
            names.index(term.symbol): self.places(k)[0] for k, term in enumerate(self.terms) if "__late" in term.text
        }
        return own | offered

    @cached_property
    def _held(self) -> tuple[int, ...]:
        """Inputs that a candidate holds the other way between samples."""
        names = list(self.model.inputs)
        return tuple(names.index(term.symbol) for term in self.terms if re.search(r"__held\b", term.text))

    @cached_property
    def linear(self) -> Array:
        """1 where an input of the program runs on a line between samples, (inputs,)."""
        own = self.model.linear_inputs
        return np.concatenate([own, *(np.full(3, own[j]) for j in self._late), 1.0 - own[list(self._held)]])

    def inputs(self, p: Array) -> Array:
        """The program's inputs at the delays in p, (N, inputs)."""
        if not self._late and not self._held:
            return self.record.u
        delays = {j: float(p[place]) for j, place in self._late.items()}
        known = self.__dict__.setdefault("_inputs", {})
        key = tuple(delays.values())
        if key not in known:
            known.clear()
            known[key] = channels(self.record, delays, dict.fromkeys(self._held, True))
        return np.asarray(known[key])

    def delay(self, p: Array) -> float:
        """The longest time, at the delays in p, by which an input acts later than it was measured."""
        return max((float(p[place]) for place in self._late.values()), default=0.0)

    @cached_property
    def seen(self) -> npt.NDArray[np.bool_]:
        """Which measurements are there, (N, outputs)."""
        return ~np.isnan(self.record.y)

    @cached_property
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
        for term in self.terms:
            low += [term.effect.lowest] * len(term.coefficients)
            high += [np.inf] * len(term.coefficients)
            for name, inner in term.inner.items():
                zero, unit = self.unit(term, name)
                low.append(zero + inner.low * unit)
                top = zero + inner.high * unit
                high.append(min(top, np.pi / self.step) if inner.of == "frequency" else top)
        return np.array(low), np.array(high)

    def unit(self, term: Term, name: str) -> tuple[float, float]:
        """The zero and the unit in which an inner scale's start and range are given."""
        low, high = self.reach.get(term.variable, (0.0, 1.0))
        match term.inner[name].of:
            case "spread":
                return 0.0, (high - low) or 1.0
            case "range":
                return low, (high - low) or 1.0
            case "frequency":
                return 0.0, 2.0 * np.pi / self.length
            case "time":
                return 0.0, self.length
            case "step":
                return 0.0, self.step
            case _:
                return 0.0, 1.0

    @cached_property
    def reach(self) -> dict[str, tuple[float, float]]:
        """The visited range of every state (along the path at the start), input and output, and of the time."""
        columns = dict(zip(self.model.states, self.path.T, strict=True))
        columns |= dict(zip(self.model.inputs, self.record.u.T, strict=True))
        columns |= {name: y[~np.isnan(y)] for name, y in zip(self.model.outputs, self.record.y.T, strict=True)}
        columns |= {"t": self.record.t}
        return {name: (float(c.min()), float(c.max())) if len(c) else (0.0, 1.0) for name, c in columns.items()}

    @property
    def length(self) -> float:
        """The longest run, in units of time."""
        return max(float(run.t[-1] - run.t[0]) for run in self.record.runs)

    @cached_property
    def step(self) -> float:
        """The median step of the first run."""
        return float(np.median(self.record.runs[0].dt))

    @cached_property
    def _places(self) -> tuple[tuple[list[int], ...], tuple[list[int], ...]]:
        """Where each candidate's parameters stand in p, and its states in x0."""
        p, x = len(self.model.parameters), len(self.model.states)
        parameters, states = [], []
        for term in self.terms:
            parameters.append(list(range(p, p + len(term.names))))
            states.append(list(range(x, x + len(term.states))))
            p, x = p + len(term.names), x + len(term.states)
        return tuple(parameters), tuple(states)

    def places(self, k: int) -> list[int]:
        """Indices of candidate k's parameters."""
        return self._places[0][k]

    def states(self, k: int) -> list[int]:
        """Indices of the states that candidate k brings along."""
        return self._places[1][k]

    def columns(self, active: Sequence[int]) -> Index:
        """Indices of the parameters that a fit with these candidates moves; a pinned coefficient stays."""
        if self.frozen:
            return np.zeros(0, dtype=np.int64)
        sds = self.prior[1]
        chosen = [j for j in range(len(self.model.parameters)) if sds[j] > 0]
        for k in active:
            term = self.terms[k]
            chosen += [j for name, j in zip(term.names, self.places(k), strict=True) if name in term.counted]
        return np.array(chosen, dtype=np.int64)

    def layout(self, active: Sequence[int], also: Sequence[int] = (), columns: Index | None = None) -> Layout:
        """Theta for a set of candidates; those of `also` run too, but nothing of theirs is free unless in `columns`."""
        n = len(self.model.states)
        on = self.program.all_off()
        running, free = list(range(n)), np.flatnonzero(self.free_x0).tolist()
        for k in (*active, *also):
            brought = self.states(k)
            on[k] = len(running) if brought else 1
            if k not in also:
                flags = [z[2] for z in self.terms[k].states.values()]
                free += [len(running) + i for i, flag in enumerate(flags) if flag]
            running += brought
        moved = self.columns(active) if columns is None else columns
        return Layout(tuple(active), on, np.array(running), np.array(free, dtype=np.int64), moved)

    @cached_property
    def angles(self) -> Array:
        """1 for each output that is an angle, else 0, (outputs,)."""
        return self.model.angles
