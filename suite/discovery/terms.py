"""A candidate as the engine sees it: where a term acts, and what it brings along."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import sympy

from suite import expressions
from suite.effect import Effect, Inner
from suite.kernels import codegen
from suite.model import Model, Parameter

Place = Literal["rate", "output", "input", "parameter", "clock"]
CHANNELS = ("late", "slope", "tau", "held")  # what an input may look like besides its samples; see delays.py


@dataclass(frozen=True)
class Term:
    """A candidate: one effect in one equation of one model.

    `text` is the term in the model's names; `coefficients`, `inner` and `states` (rate, first value, whether that is
    estimated) are new names; `variable` is what it is a function of, for a picture. `place` says what it is added to:
    the rate or output `equation`, or the input or parameter `symbol` wherever that stands, or (clock) to every rate.
    `source` is a state whose rate loses the same, "" for none.
    """

    effect: Effect
    equation: str
    text: str
    coefficients: tuple[str, ...]
    inner: Mapping[str, Inner]
    variable: str
    place: Place = "rate"
    symbol: str = ""
    states: Mapping[str, tuple[str, str, bool]] = field(default_factory=dict)
    source: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """All new parameters, coefficients first."""
        return (*self.coefficients, *self.inner)

    @property
    def counted(self) -> tuple[str, ...]:
        """The parameters that a fit moves: a pinned coefficient stays at 1, a reference scale where it is."""
        moving = tuple(name for name, inner in self.inner.items() if inner.moves)
        return moving if self.effect.pinned else (*self.coefficients, *moving)

    @property
    def stated(self) -> tuple[str, ...]:
        """The parameters that stand in the grown model: all but a pinned coefficient."""
        return tuple(self.inner) if self.effect.pinned else self.names

    def parameter(self, name: str, value: float, low: float, high: float) -> Parameter:
        """One of its parameters as the grown model has it."""
        if name in self.inner and not self.inner[name].moves:
            return Parameter(value, fixed=True)
        return Parameter(value, free=True, bounds=(low, high))

    @property
    def key(self) -> tuple[str, str, str]:
        """What makes two candidates the same."""
        return (self.effect.id, self.equation, self.text)

    @property
    def label(self) -> str:
        """The effect with its equation: what the verdict's lists are keyed by."""
        return f"{self.effect.id}@{self.equation}"

    @property
    def shown(self) -> str:
        """The term as people read it."""
        text = re.sub(r"([A-Za-z]\w*)__late", rf"\1(t - {self.coefficients[0]})", self.text)
        text = re.sub(r"([A-Za-z]\w*)__held", r"held(\1)", text)
        if self.effect.pinned:
            text = re.sub(rf"\b{self.coefficients[0]}\*", "", text)
        match self.place:
            case "input" | "parameter":
                return f"{self.symbol} -> {self.symbol} {text[0]} {text[1:]}"
            case "clock":
                return f"all rates times (1 {text[0]} {text[1:].removesuffix('*1')})"
            case _:
                return f"{text}, which {self.source} loses" if self.source else text


def renamed(text: str, names: Mapping[str, str]) -> str:
    """The text of an expression with other names."""
    return re.sub(r"[A-Za-z_]\w*", lambda match: names.get(match.group(), match.group()), text)


def gates(model: Model, terms: Sequence[Term]) -> tuple[tuple[str, ...], tuple[codegen.Gate, ...]]:
    """The parameters and gated terms that extend the model's program by all candidates.

    Each candidate's parameters and states get names of their own: c<number>__<name>.
    """
    names: list[str] = []
    built = []
    order = list(model.states)
    channels = {f"{name}__{channel}" for name in model.inputs for channel in CHANNELS}
    declared = set(model.states) | set(model.parameters) | set(model.inputs) | channels
    for k, term in enumerate(terms):
        own = {name: f"c{k}__{name}" for name in (*term.names, *term.states)}
        known, where = declared | set(own.values()), f"effect {term.effect.id}"
        added = expressions.parse(renamed(term.text, own), known, where)
        names += [own[name] for name in term.names]
        if term.place == "input" and "__late" in term.text:
            added = _late(added, term.symbol, own[term.coefficients[0]])
        states = {own[z]: expressions.parse(renamed(rate, own), known, where) for z, (rate, _, _) in
                  term.states.items()}  # fmt: skip
        rates: dict[int, sympy.Expr] = {}
        outputs: dict[int, sympy.Expr] = {}
        match term.place:
            case "rate":
                rates = {order.index(term.equation): added}
                rates |= {order.index(term.source): -added} if term.source else {}
            case "output":
                outputs = {list(model.outputs).index(term.equation): added}
            case "clock":
                rates = {i: added * rate for i, rate in enumerate(model.rates)}
            case _:
                rates = _substituted(model.rates, term.symbol, added)
                outputs = _substituted(model.output_expressions, term.symbol, added)
        built.append(codegen.Gate(rates, outputs, states))
    return tuple(names), tuple(built)


def _substituted(equations: Sequence[sympy.Expr], name: str, added: sympy.Expr) -> dict[int, sympy.Expr]:
    """What the equations gain when the named symbol becomes symbol + added, by index."""
    s = expressions.symbol(name)
    return {i: sympy.expand(e.subs(s, s + added) - e) for i, e in enumerate(equations) if e.has(s)}


def _late(added: sympy.Expr, name: str, delay: str) -> sympy.Expr:
    """With the delayed input linearised about the delay that its channels were made at: exact there, and so is its
    derivative.
    """
    late, slope, tau = (expressions.symbol(f"{name}__{channel}") for channel in ("late", "slope", "tau"))
    return added.subs(late, late - (expressions.symbol(delay) - tau) * slope)
