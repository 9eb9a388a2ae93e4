"""Model: the equations an engineer trusts, and how well each number in them is known."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Literal

import numpy as np
import numpy.typing as npt
import sympy

from suite import expressions
from suite.effect import Effect
from suite.errors import ModelError
from suite.kernels import codegen
from suite.kernels.integrate import transition
from suite.names import check_names

Array = npt.NDArray[np.float64]
Hold = Literal["previous", "linear"]


@dataclass(frozen=True)
class Parameter:
    """A number of the model: its start value and how well it is known.

    `sd` is one standard deviation of prior knowledge; without it a weak prior of +-100 % of the value holds, which
    `free` lifts. `fixed` numbers are exact. `bounds` are (low, high), either may be infinite.
    """

    value: float
    sd: float | None = None
    fixed: bool = False
    free: bool = False
    unit: str | None = None
    bounds: tuple[float, float] = (-math.inf, math.inf)

    @property
    def prior_sd(self) -> float:
        """Standard deviation of the prior: 0 if fixed, infinite if nothing is known."""
        if self.fixed:
            return 0.0
        if self.sd is not None:
            return self.sd
        return math.inf if self.free or self.value == 0.0 else abs(self.value)


@dataclass(frozen=True)
class Input:
    """A measured input: its column, and what it does between samples ("previous": constant, "linear": a line).

    `delay` names the parameter by which it acts later than it was measured, in units of time.
    """

    column: str
    hold: Hold = "previous"
    delay: str | None = None


@dataclass(frozen=True)
class Output:
    """A measured quantity: its equation in the states, its column, its noise sd if known; angles wrap at +-pi."""

    equation: str
    column: str
    sigma: float | None = None
    angle: bool = False


@dataclass(frozen=True)
class Initial:
    """The state at the first sample: known, or (`estimate`) a guess from which it is estimated."""

    value: float
    estimate: bool = False


@dataclass(frozen=True)
class Model:
    """An ODE model x' = f(x, u, t; p), y = h(x, u, t; p), as text with everything known beside it.

    The text of the equations is the data; functions, Jacobians and LaTeX follow from it. Models are never changed:
    `plus`, `with_values` and `with_disturbance` return new ones. `units` names the unit of states, inputs and t;
    `effects` are the user's own. Raises ModelError with the place and the mend.
    """

    name: str
    states: Mapping[str, str]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    inputs: Mapping[str, Input] = field(default_factory=dict)
    outputs: Mapping[str, Output] = field(default_factory=dict)
    initial: Mapping[str, Initial] = field(default_factory=dict)
    suspect: tuple[str, ...] | None = None
    time: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()
    source: str = field(default="model", compare=False)

    def __post_init__(self) -> None:
        check_names(self)
        # Parsing here means that a Model that exists has sound equations.
        _ = self.rates, self.output_expressions

    @cached_property
    def rates(self) -> tuple[sympy.Expr, ...]:
        """The right-hand sides, in the order of the states."""
        return tuple(
            expressions.parse(text, self._declared, f"{self.source}, [states] {name}")
            for name, text in self.states.items()
        )

    @cached_property
    def output_expressions(self) -> tuple[sympy.Expr, ...]:
        """The output equations, in the order of the outputs."""
        return tuple(
            expressions.parse(output.equation, self._declared, f"{self.source}, [outputs] {name}")
            for name, output in self.outputs.items()
        )

    @property
    def _declared(self) -> frozenset[str]:
        return frozenset(self.states) | frozenset(self.parameters) | frozenset(self.inputs)

    @cached_property
    def definitions(self) -> frozenset[str]:
        """States whose rate is another state itself (p' = v): exact by definition, never in doubt."""
        names = {expressions.symbol(name) for name in self.states}
        return frozenset(name for name, rate in zip(self.states, self.rates, strict=True) if rate in names)

    @property
    def suspects(self) -> tuple[str, ...]:
        """The states whose equations may be wrong: as the file says, else all that are not definitions."""
        if self.suspect is not None:
            return self.suspect
        return tuple(name for name in self.states if name not in self.definitions)

    @property
    def values(self) -> Array:
        """Parameter values, (parameters,)."""
        return np.array([parameter.value for parameter in self.parameters.values()])

    @property
    def linear_inputs(self) -> Array:
        """1 where an input runs on a line between samples, 0 where it is held, (inputs,)."""
        return np.array([float(entry.hold == "linear") for entry in self.inputs.values()])

    @property
    def angles(self) -> Array:
        """1 where an output is an angle, whose residual wraps at +-pi, (outputs,)."""
        return np.array([float(output.angle) for output in self.outputs.values()])

    @cached_property
    def program(self) -> codegen.Program:
        """The compiled rate and output functions with their derivatives."""
        return codegen.compile_program(
            states=tuple(self.states),
            inputs=tuple(self.inputs),
            parameters=tuple(self.parameters),
            rates=self.rates,
            outputs=self.output_expressions,
        )

    def rate(self, t: float, x: Array, u: Sequence[float] = (), p: Array | None = None) -> Array:
        """x' = f(x, u, t; p), (n,)."""
        return self.program.rates(t, x, u, self.values if p is None else p)[0]

    def jacobian(self, t: float, x: Array, u: Sequence[float] = (), p: Array | None = None) -> Array:
        """df/dx, (n, n)."""
        return self.program.rates(t, x, u, self.values if p is None else p)[1]

    def output(self, t: float, x: Array, u: Sequence[float] = (), p: Array | None = None) -> Array:
        """y = h(x, u, t; p), (outputs,)."""
        return self.program.outputs(t, x, u, self.values if p is None else p)[0]

    def output_jacobian(self, t: float, x: Array, u: Sequence[float] = (), p: Array | None = None) -> Array:
        """dh/dx, (outputs, n)."""
        return self.program.outputs(t, x, u, self.values if p is None else p)[1]

    def step(self, t: float, x: Array, u: Sequence[float], dt: float, u_next: Sequence[float] | None = None) -> Array:
        """The state one sample later, (n,); inputs with a linear hold run from `u` to `u_next`."""
        return self.transition(t, x, u, dt, u_next)[0]

    def transition(
        self, t: float, x: Array, u: Sequence[float], dt: float, u_next: Sequence[float] | None = None
    ) -> tuple[Array, Array]:
        """The state one sample later, (n,), and its derivative by the state now, (n, n)."""
        start = np.asarray(u, dtype=np.float64)
        end = start if u_next is None else np.asarray(u_next, dtype=np.float64)
        return transition(
            self.program, t, np.asarray(x, dtype=np.float64), start, end, self.linear_inputs, self.values, dt
        )

    def plus(
        self,
        place: str,
        term: str,
        parameters: Mapping[str, Parameter] = MappingProxyType({}),
        states: Mapping[str, str] = MappingProxyType({}),
        initial: Mapping[str, Initial] = MappingProxyType({}),
        measured: bool = False,
    ) -> Model:
        """The model with `term` (text that opens with its sign) added to a state's rate or to an output; to an input
        or a parameter wherever that stands; or (`place` is t, a clock that runs wrong) times every rate to every rate.

        `states` come along, with their rates and `initial` values; they are not in doubt. `measured`: the place is an
        output, also where a state has its name.
        """
        rates = dict(self.states)
        texts = {name: output.equation for name, output in self.outputs.items()}
        if place in rates and not measured:
            rates[place] = f"{rates[place]} {_signed(term)}"
        elif place in texts:
            texts[place] = f"{texts[place]} {_signed(term)}"
        elif place in self.inputs or place in self.parameters:
            changed = f"({place} {_signed(term)})"
            rates = {name: _replaced(text, place, changed) for name, text in rates.items()}
            texts = {name: _replaced(text, place, changed) for name, text in texts.items()}
        elif place == expressions.TIME:
            rates = {name: f"(1 {_signed(term)})*({text})" for name, text in rates.items()}
        else:
            known = ", ".join([*self.states, *self.outputs, *self.inputs, *self.parameters])
            raise ModelError(f"{self.source}: no equation {place!r} to add a term to; choose one of {known}")
        in_doubt = self.suspects if states or place == expressions.TIME else self.suspect
        return replace(
            self,
            states={**rates, **states},
            outputs={name: replace(output, equation=texts[name]) for name, output in self.outputs.items()},
            parameters={**self.parameters, **parameters},
            initial={**self.initial, **initial},
            suspect=in_doubt,
        )

    def with_input(self, name: str, parameters: Mapping[str, Parameter], delay: str | None, hold: Hold) -> Model:
        """The model with an input that acts later, by the parameter `delay`, or is held otherwise between samples."""
        changed = replace(self.inputs[name], hold=hold, delay=delay or self.inputs[name].delay)
        return replace(self, inputs={**self.inputs, name: changed}, parameters={**self.parameters, **parameters})

    def with_values(self, values: Mapping[str, float]) -> Model:
        """The model with other parameter values; everything known about them stays."""
        grown = {name: replace(p, value=values.get(name, p.value)) for name, p in self.parameters.items()}
        return replace(self, parameters=grown)

    def with_disturbance(self, states: Sequence[str]) -> Model:
        """The model with an additive disturbance state, constant by itself, in the rate of each named state."""
        extra = {f"d_{name}": name for name in states}
        for name in extra:
            if name in self._declared:
                raise ModelError(
                    f"{self.source}: a disturbance state would be called {name}, as one is; rename that one"
                )
        rates = {name: f"{text} + d_{name}" if name in states else text for name, text in self.states.items()}
        initial = {**self.initial, **{name: Initial(0.0, estimate=True) for name in extra}}
        return replace(self, states={**rates, **dict.fromkeys(extra, "0")}, initial=initial)

    def latex(self) -> str:
        """The equations as an aligned block of LaTeX."""
        rows = [
            rf"\dot{{{expressions.latex(expressions.symbol(name))}}} &= {expressions.latex(rate)}"
            for name, rate in zip(self.states, self.rates, strict=True)
        ] + [
            rf"\mathrm{{{name}}} &= {expressions.latex(equation)}"
            for name, equation in zip(self.outputs, self.output_expressions, strict=True)
        ]
        return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"

    def __str__(self) -> str:
        rows = [f"{name}' = {text}" for name, text in self.states.items()]
        rows += [f"{name} = {output.equation}" for name, output in self.outputs.items()]
        return "\n".join(rows)


def _replaced(text: str, name: str, by: str) -> str:
    """The text with a name replaced wherever it stands as a word of its own."""
    return re.sub(rf"(?<![A-Za-z0-9_]){name}(?![A-Za-z0-9_])", by, text)


def _signed(term: str) -> str:
    """A term as it follows an equation: '-a*x' -> '- a*x', 'a*x' -> '+ a*x'."""
    text = term.strip()
    return f"{text[0]} {text[1:].lstrip()}" if text[:1] in "+-" else f"+ {text}"
