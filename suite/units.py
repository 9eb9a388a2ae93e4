"""Units of a model: whether its equations agree with them, and the unit of what an effect brings along."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import sympy

from suite import expressions
from suite.dimensions import Known, Reader, in_unit, said_of
from suite.errors import ModelError
from suite.quantities import Unit, close, compact, pure, unit

if TYPE_CHECKING:
    from suite.discovery.terms import Term
    from suite.model import Model


def check(model: Model) -> None:
    """Raise ModelError at the first unit that is none, or the first place where unlike things meet."""
    if not _has_units(model):
        return
    units = _declared(model)
    for name, rate in zip(model.states, model.rates, strict=True):
        reader = Reader(units, f"{model.source}, [states] {name}")
        wanted = _rate_unit(units, name)
        for term in sympy.Add.make_args(rate):
            known = reader.of(term)
            if known is None or wanted is None or term == 0 or reader.agree(term, known, Known(wanted)):
                continue
            said = (
                f"the term {said_of(term)} is {in_unit(known)}, but {name}' is in {compact(wanted) or 'pure numbers'}"
            )
            raise reader.refuse(said, known, wanted, bare=term.is_number)
        reader.of(rate)
    for name, equation in zip(model.outputs, model.output_expressions, strict=True):
        Reader(units, f"{model.source}, [outputs] {name}").of(equation)
    for name, entry in model.inputs.items():
        if entry.delay in units and expressions.TIME in units:
            known, wanted = Known(units[entry.delay]), units[expressions.TIME]
            reader = Reader(units, f"{model.source}, [inputs] {name} delay")
            if not reader.agree(expressions.symbol(entry.delay), known, Known(wanted)):
                raise reader.refuse(f"{entry.delay} is {in_unit(known)}, but t is in {compact(wanted)}", known, wanted)


def brought(term: Term, model: Model) -> dict[str, str | None]:
    """The units of a candidate's coefficients, inner scales and added states; None where nothing determines one.

    A coefficient is in the unit of what the term is added to by that of the term with the coefficient 1; an inner scale
    in what makes its function's argument a pure number, else in the unit of the quantity that it is a scale of.
    """
    nothing: dict[str, str | None] = dict.fromkeys((*term.names, *term.states))
    if not _has_units(model):
        return nothing
    units = _lenient(model)
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
    targets = [(whole, _target(term, units, model)), *((rates[z], _rate_unit(units, z)) for z in rates)]
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
            return _rate_unit(units, term.equation)
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


def _has_units(model: Model) -> bool:
    return bool(model.units) or any(parameter.unit for parameter in model.parameters.values())


def _declared(model: Model) -> dict[str, Unit]:
    """The units of all names that have one; a text that is no unit is refused."""
    texts = {f"[units] {name}": (name, text) for name, text in model.units.items()}
    texts |= {f"[parameters] {name} unit": (name, p.unit) for name, p in model.parameters.items() if p.unit}
    found = {}
    for place, (name, text) in texts.items():
        known = unit(text)
        if known is None:
            near = close(text)
            hint = f" (did you mean {near}?)" if near else ""
            raise ModelError(
                f"{model.source}, {place}: {text!r} is no unit that is known{hint}; "
                'write one such as "m", "N*s/m" or "1/s^2", or leave it out'
            )
        found[name] = known
    return found


def _rate_unit(units: Mapping[str, Unit], state: str) -> Unit | None:
    if state not in units or expressions.TIME not in units:
        return None
    return units[state] / units[expressions.TIME]


def _text(model: Model, name: str) -> str | None:
    """The unit of a state, an input, a parameter or t, as the model's file writes it."""
    return model.parameters[name].unit if name in model.parameters else model.units.get(name)


def _lenient(model: Model) -> dict[str, Unit]:
    """The units of all names that have one that is known."""
    texts = {name: _text(model, name) for name in (*model.units, *model.parameters)}
    found = {name: unit(text) for name, text in texts.items() if text}
    return {name: known for name, known in found.items() if known is not None}
