"""Units of a model: whether its equations agree with them."""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from suite import expressions
from suite.dimensions import Known, Reader, in_unit, said_of
from suite.errors import ModelError
from suite.model import Model
from suite.quantities import Unit, close, compact, unit


def check(model: Model) -> None:
    """Raise ModelError at the first unit that is none, or the first place where unlike things meet."""
    if not has_units(model):
        return
    units = _declared(model)
    for name, rate in zip(model.states, model.rates, strict=True):
        reader = Reader(units, f"{model.source}, [states] {name}")
        wanted = rate_unit(units, name)
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


def has_units(model: Model) -> bool:
    """Whether anything in it has a unit."""
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


def rate_unit(units: Mapping[str, Unit], state: str) -> Unit | None:
    """The unit of a state's rate, None where that of the state or of t is unknown."""
    if state not in units or expressions.TIME not in units:
        return None
    return units[state] / units[expressions.TIME]


def _text(model: Model, name: str) -> str | None:
    """The unit of a state, an input, a parameter or t, as the model's file writes it."""
    return model.parameters[name].unit if name in model.parameters else model.units.get(name)


def lenient(model: Model) -> dict[str, Unit]:
    """The units of all names that have one that is known."""
    texts = {name: _text(model, name) for name in (*model.units, *model.parameters)}
    found = {name: unit(text) for name, text in texts.items() if text}
    return {name: known for name, known in found.items() if known is not None}
