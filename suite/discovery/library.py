"""From effects to candidates: which terms could be missing in this model, given the roles its states play.

Roles are read off the equations. p' = v makes p a position and v its rate. A state whose rate depends on it only
through (x - A), A a parameter or an input, deviates from the level A. A state is a temperature if its name or the
unit of its level says so.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import sympy

from suite import expressions
from suite.effect import Effect, Inner
from suite.kernels import codegen
from suite.model import Model, Parameter

Array = npt.NDArray[np.float64]

CELSIUS = ("c", "degc", "celsius", "°c")
KELVIN = ("k", "kelvin")


@dataclass(frozen=True)
class Term:
    """A candidate: one effect in one equation of one model.

    `text` is the term in the model's names; `coefficients` and `inner` are new parameter names; `variable` is the
    state (or time) that it is a function of, for a picture.
    """

    effect: Effect
    equation: str
    text: str
    coefficients: tuple[str, ...]
    inner: Mapping[str, Inner]
    variable: str

    @property
    def names(self) -> tuple[str, ...]:
        """All new parameters, coefficients first."""
        return (*self.coefficients, *self.inner)

    @property
    def key(self) -> tuple[str, str, str]:
        """What makes two candidates the same."""
        return (self.effect.id, self.equation, self.text)

    def scale(self, name: str, spread: Mapping[str, float], length: float) -> float:
        """The unit in which an inner scale's range is given: the visited range, a frequency, or one."""
        match self.inner[name].of:
            case "spread":
                return spread.get(self.variable, 1.0)
            case "frequency":
                return 2.0 * np.pi / length
            case _:
                return 1.0


def candidates(model: Model, effects: Mapping[str, Effect], absolute: bool = False) -> tuple[Term, ...]:
    """Every effect in every suspect equation where its roles are played.

    The model's symmetries are kept: where no equation depends on a state's absolute value (height in free fall), no
    candidate may either, unless `absolute`.
    """
    used = set().union(*(rate.free_symbols for rate in model.rates))
    hidden = set() if absolute else {s for s in model.states if expressions.symbol(s) not in used}
    names = _Names(model)
    found: dict[tuple[str, sympy.Expr], Term] = {}
    for equation in model.suspects:
        own: list[Term] = []
        level = _level(model, equation)
        for effect in effects.values():
            own += _bind(model, effect, equation, level, names)
        for term in sorted(own, key=lambda term: term.effect.generic):
            shape = expressions.parse(term.text, names.all | set(term.names), f"effect {term.effect.id}")
            if any(expressions.symbol(s) in shape.free_symbols for s in hidden):
                continue
            # The first of two terms of the same shape stays: physics before a generic stand-in.
            generic = shape.subs({expressions.symbol(n): sympy.Symbol(f"c{i}") for i, n in enumerate(term.names)})
            found.setdefault((equation, generic if _positive(generic) else -generic), term)
    return tuple(found.values())


def _positive(shape: sympy.Expr) -> bool:
    return not shape.could_extract_minus_sign()


class _Names:
    """New parameter names that collide with nothing in the model."""

    def __init__(self, model: Model) -> None:
        self.all = frozenset(model.states) | frozenset(model.parameters) | frozenset(model.inputs)
        self.taken = set(self.all)

    def fresh(self, wanted: str) -> str:
        """`wanted`, or with the first free number behind it."""
        if wanted not in self.all and wanted not in expressions.RESERVED:
            return wanted
        number = 1
        while f"{wanted}_{number}" in self.all:
            number += 1
        return f"{wanted}_{number}"


def _bind(model: Model, effect: Effect, equation: str, level: str | None, names: _Names) -> Iterator[Term]:
    """The effect with its role letters replaced by the states that play them in this equation."""
    position = next((p for p in model.definitions if model.states[p].strip() == equation), None)
    wanted = set(effect.roles.values())
    mechanical = position is not None
    if wanted & {"position", "rate"} and not mechanical:
        return
    if "state" in wanted and mechanical:
        return
    deviation = f"({equation} - {level})" if level else equation
    kelvin = _kelvin(model, equation, level)
    if wanted & {"temperature", "level"} and (kelvin is None or ("level" in wanted and level is None)):
        return
    offset = f" + {kelvin:g}" if kelvin else ""
    own = {position, equation} if mechanical else {equation}
    others = [s for s in model.states if s not in own] if "other" in wanted else [""]
    if "other" in wanted and effect.id == "product_coupling":
        others = [s for s in model.states if s != equation]
    for other in others:
        filled = {
            "position": position or "",
            "rate": equation,
            "state": equation,
            "any": equation,
            "other": other,
            "deviation": deviation,
            "temperature": f"({equation}{offset})",
            "level": f"({level}{offset})",
        }
        letters = {letter: filled[role] for letter, role in effect.roles.items()}
        fresh = {name: names.fresh(name) for name in (*effect.coefficients, *effect.inner)}
        text = re.sub(r"abs\(\(([^()]*)\)\)", r"abs(\1)", _renamed(effect.term, letters | fresh))
        yield Term(
            effect,
            equation,
            text,
            tuple(fresh[name] for name in effect.coefficients),
            {fresh[name]: inner for name, inner in effect.inner.items()},
            other or (position if "position" in wanted and position else equation),
        )


def _renamed(text: str, names: Mapping[str, str]) -> str:
    """The term with its names replaced."""
    return re.sub(r"[A-Za-z_]\w*", lambda match: names.get(match.group(), match.group()), text)


def _level(model: Model, equation: str) -> str | None:
    """The parameter or input that this state relaxes to: the rate depends on (x - A) alone."""
    rate = model.rates[list(model.states).index(equation)]
    x = expressions.symbol(equation)
    by_x = sympy.diff(rate, x)
    if by_x == 0:
        return None
    for name in (*model.parameters, *model.inputs):
        level = expressions.symbol(name)
        if level in rate.free_symbols and sympy.expand(by_x + sympy.diff(rate, level)) == 0:
            return name
    return None


def _kelvin(model: Model, equation: str, level: str | None) -> float | None:
    """What to add for kelvin if this state is a temperature (0 or 273.15), None if it is none.

    The unit of the level decides; without a unit, a state named T, T1, temp... is one, in kelvin if its level or
    first value is above 200.
    """
    parameter = model.parameters.get(level) if level else None
    unit = (parameter.unit or "").strip().lower() if parameter else ""
    if unit in CELSIUS:
        return 273.15
    if unit in KELVIN:
        return 0.0
    if not re.match(r"(T\d*$|T_|temp)", equation):
        return None
    value = parameter.value if parameter else (model.initial[equation].value if equation in model.initial else 0.0)
    return 0.0 if value > 200 else 273.15


def grown(model: Model, terms: Sequence[Term], numbers: Sequence[Mapping[str, Parameter]]) -> Model:
    """The model with the terms added, their parameters as in `numbers` under names that are not taken."""
    for term, at in zip(terms, numbers, strict=True):
        names = _Names(model)
        renamed = {name: names.fresh(name) for name in term.names}
        text = _renamed(term.text, renamed)
        model = model.plus(term.equation, text, {renamed[name]: at[name] for name in term.names})
    return model


def gates(model: Model, terms: tuple[Term, ...]) -> tuple[tuple[str, ...], tuple[codegen.Gate, ...]]:
    """The parameters and gated terms that extend the model's program by all candidates.

    Each candidate's parameters get names of their own: <number>__<name>.
    """
    names: list[str] = []
    built = []
    order = list(model.states)
    declared = set(model.states) | set(model.parameters) | set(model.inputs)
    for k, term in enumerate(terms):
        own = {name: f"c{k}__{name}" for name in term.names}
        text = _renamed(term.text, own)
        expression = expressions.parse(text, declared | set(own.values()), f"effect {term.effect.id}")
        names += own.values()
        built.append(codegen.Gate(rates={order.index(term.equation): expression}))
    return tuple(names), tuple(built)
