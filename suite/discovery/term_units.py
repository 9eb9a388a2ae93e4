"""The units of what an effect brings along."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import sympy

from suite import expressions
from suite.dimensions import Reader
from suite.discovery.terms import Term
from suite.errors import ModelError
from suite.model import Model
from suite.quantities import Unit, compact, pure, unit
from suite.units import has_units, lenient, rate_unit


def brought(term: Term, model: Model) -> dict[str, str | None]:
    """The units of a candidate's coefficients, inner scales and added states; None where nothing determines one.

    A coefficient is in the unit of what the term is added to by that of the term with the coefficient 1; an inner scale
    in what makes its function's argument a pure number, else in the unit of the quantity that it is a scale of.
    """
    nothing: dict[str, str | None] = dict.fromkeys((*term.names, *term.states))
    if not has_units(model):
        return nothing
    units = lenient(model)
    units |= {f"{u}__{as_it}": units[u] for u in model.inputs if u in units for as_it in ("late", "held")}
    known = {*nothing, *model.states, *model.parameters, *model.inputs, *(f"{u}__late" for u in model.inputs),
             *(f"{u}__held" for u in model.inputs)}  # fmt: skip

    def parsed(text: str) -> Any:
        return expressions.parse(text, known, f"effect {term.effect.id}")

    whole = parsed(term.text)
    rates = {z: parsed(rate) for z, (rate, _, _) in term.states.items()}
    for name, inner in term.inner.items():
        argued = (_in_argument(expression, name, units) for expression in (whole, *rates.values()))
        scale = next((s for s in argued if s is not None), None) if inner.of != "frequency" else None
        _keep(units, name, scale if scale is not None else _reach(term, name, units, model))
    for z, (_, start, _) in term.states.items():
        found = _unit_of(parsed(start), units) if parsed(start) != 0 else None
        if found is None and expressions.TIME in units:
            # The rate's first part that is known, times the time.
            parts = (_unit_of(part, units) for part in sympy.Add.make_args(rates[z]))
            rate = next((part for part in parts if part is not None), None)
            found = None if rate is None else rate * units[expressions.TIME]
        _keep(units, z, found)
    targets = [(whole, _target(term, units, model)), *((rates[z], rate_unit(units, z)) for z in rates)]
    for name in term.coefficients:
        if "__late" in term.text:
            _keep(units, name, units.get(expressions.TIME))
        for expression, target in targets:
            _keep(units, name, _factor(expression, name, target, units) if name not in units else None)
    texts = {name: compact(units[name]) or None for name in nothing if name in units}
    # A place on a scale with an offset is read on that scale.
    variable = model.outputs[term.variable].equation if term.variable in model.outputs else term.variable
    places = {n: model.units.get(variable) for n, i in term.inner.items() if i.of == "range"}
    return nothing | texts | {n: text for n, text in places.items() if text and texts.get(n) in ("K", "°R")}


def _keep(units: dict[str, Unit], name: str, found: Unit | None) -> None:
    if found is not None:
        units[name] = found


def _unit_of(expression: Any, units: Mapping[str, Unit]) -> Unit | None:
    """The unit, None where it is unknown or the units contradict each other."""
    try:
        known = Reader(units, "").of(expression)
    except ModelError:
        return None
    return None if known is None else known.unit


def _target(term: Term, units: Mapping[str, Unit], model: Model) -> Unit | None:
    """The unit of what the term is added to."""
    match term.place:
        case "rate":
            return rate_unit(units, term.equation)
        case "output":
            return _unit_of(model.output_expressions[list(model.outputs).index(term.equation)], units)
        case "clock":
            return pure()
        case _:
            return units.get(term.symbol)


def _factor(expression: Any, name: str, target: Unit | None, units: Mapping[str, Unit]) -> Unit | None:
    """The unit of a coefficient that stands before something whose unit is known."""
    rest = sympy.diff(expression, expressions.symbol(name))
    if target is None or rest == 0 or rest.has(expressions.symbol(name)):
        return None
    beside = _unit_of(rest, units)
    return None if beside is None else target / beside


def _in_argument(expression: Any, name: str, units: Mapping[str, Unit]) -> Unit | None:
    """The unit of a scale that makes a function's argument a pure number."""
    scale = expressions.symbol(name)
    for argument in _arguments(expression):
        for part in sympy.Add.make_args(argument):
            beside, power = part.as_independent(scale, as_Add=False)
            base, exponent = power.as_base_exp()
            found = _unit_of(beside, units) if base == scale and exponent.is_number else None
            if found is not None:
                return found ** (-1 / float(exponent))
    return None


def _arguments(expression: Any) -> Iterator[Any]:
    """Everything in the expression that a function takes as a pure number."""
    for node in sympy.preorder_traversal(expression):
        measures = isinstance(node, sympy.Abs | sympy.sign | sympy.atan2 | sympy.Min | sympy.Max)
        if node.is_Function and not measures:
            yield node.args[0]
        elif node.is_Pow:
            *_, exponent = node.args
            yield exponent


def _reach(term: Term, name: str, units: Mapping[str, Unit], model: Model) -> Unit | None:
    """The unit of the quantity that an inner scale is a scale of."""
    time = units.get(expressions.TIME)
    match term.inner[name].of:
        case "spread" | "range":
            if term.variable in model.outputs:
                return _unit_of(model.output_expressions[list(model.outputs).index(term.variable)], units)
            return units.get(term.variable)
        case "time" | "step":
            return time
        case "frequency":
            return None if time is None else unit("rad") / time
        case _:
            return None
