"""What an expression is in, from the units of its names; a sum of unlike things is refused.

A name without a unit makes what it stands in unknown, and what is unknown is not complained of: units may be given for
a part of a model. Scales are compared too (mm beside m), except where a number stands in the term, which may be the
conversion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from suite import expressions
from suite.errors import ModelError
from suite.quantities import Unit, compact, factor, kind, pure, turns, unit


@dataclass(frozen=True)
class Known:
    """The unit of an expression; `loose` where a number stands in it that may convert scales."""

    unit: Unit
    loose: bool = False


@dataclass(frozen=True)
class Reader:
    """Reads the units of expressions from those of their names; `where` opens every error sentence."""

    units: Mapping[str, Unit]
    where: str

    def of(self, expression: Any) -> Known | None:
        """The unit, None where it is unknown. Raises ModelError where unlike things meet."""
        if expression.is_number:
            return Known(pure(), loose=abs(float(expression)) != 1.0)
        if expression.is_Symbol:
            return Known(self.units[expression.name]) if expression.name in self.units else None
        if expression.is_Add or isinstance(expression, sympy.Min | sympy.Max):
            return self.like(expression.args)
        if expression.is_Mul:
            return self.product([self.of(factor) for factor in expression.args])
        if expression.is_Pow and not isinstance(expression, sympy.exp):
            return self.power(*expression.args)
        if isinstance(expression, sympy.Abs):
            return self.of(expression.args[0])
        if isinstance(expression, sympy.sign | sympy.atan2):
            self.like(expression.args)
        else:
            self.number(expression.args[0], expression.func)
        return Known(pure())

    def product(self, factors: Sequence[Known | None]) -> Known | None:
        """Of factors."""
        whole = pure()
        for known in factors:
            if known is None:
                return None
            whole = whole * known.unit
        return Known(whole, any(known is not None and known.loose for known in factors))

    def power(self, base: Any, exponent: Any) -> Known | None:
        """Of a power: a number may raise anything, a name only a pure number."""
        known = self.of(base)
        if exponent.is_number:
            value = float(exponent)
            value = int(value) if value == int(value) else value
            return None if known is None else Known(known.unit**value, known.loose)
        self.number(exponent, None)
        return known if known is not None and factor(known.unit, pure()) == 1.0 else None

    def number(self, argument: Any, function: Any) -> None:
        """Refuse what is no pure number as a function's argument (None: as an exponent)."""
        known = self.of(argument)
        if known is None:
            return
        scale = factor(known.unit, pure())
        if scale is None or not (known.loose or turns(known.unit) or _one(scale)):
            taker = "an exponent is" if function is None else f"{_name(function)} takes"
            raise self.refuse(
                f"{taker} a pure number, but {said_of(argument)} is in {compact(known.unit)}", known, pure()
            )

    def like(self, terms: Sequence[Any]) -> Known | None:
        """Of a sum, minimum or maximum, whose parts are in one unit."""
        known = [(term, self.of(term)) for term in terms if term != 0]
        ours = [(term, k) for term, k in known if k is not None]
        measured = [(term, k) for term, k in ours if not term.is_number]
        if not measured:
            # A number by itself says nothing of a name beside it.
            return Known(pure()) if ours and len(ours) == len(known) else None
        first, reference = min(measured, key=lambda entry: entry[1].loose)
        for term, k in ours:
            if not self.agree(term, k, reference):
                said = f"{said_of(term)} is {in_unit(k)}, but {said_of(first)} beside it is {in_unit(reference)}"
                raise self.refuse(said, k, reference, bare=term.is_number)
        return reference

    def agree(self, term: Any, known: Known, wanted: Known) -> bool:
        """Whether a summand may stand where the other unit is wanted."""
        scale = factor(known.unit, wanted.unit)
        if scale is None:
            # T + 273.15: the offset between two scales of temperature.
            return bool(term.is_number) and factor(wanted.unit, unit("K")) is not None
        return known.loose or wanted.loose or _one(scale)

    def refuse(self, said: str, known: Known, wanted: Known | Unit, *, bare: bool = False) -> ModelError:
        """The sentence with what would mend it: the kind of factor that is missing or too many."""
        target = wanted.unit if isinstance(wanted, Known) else wanted
        scale, ratio = factor(known.unit, target), known.unit / target
        if bare:
            mend = "make it a parameter with a unit"
        elif scale is not None:
            mend = f"multiply by {scale:.6g}, or correct a unit"
        elif kind(1 / ratio):
            mend = f"multiply by {kind(1 / ratio)}, or correct a unit"
        else:
            mend = f"divide by {kind(ratio) or f'what is in {compact(ratio)}'}, or correct a unit"
        return ModelError(f"{self.where}: {said}; {mend}")


def _one(scale: float) -> bool:
    return abs(scale - 1.0) < 1e-6


def in_unit(known: Known) -> str:
    """The unit as a sentence goes on after "is"."""
    text = compact(known.unit)
    return f"in {text}" if text else "a pure number"


def said_of(expression: Any) -> str:
    """An expression as a sentence shows it: without its sign, and short."""
    text = expressions.plain(-expression if expression.could_extract_minus_sign() else expression)
    return text if len(text) <= 60 else text[:57] + "..."


def _name(function: Any) -> str:
    return str(function.__name__).lower()
