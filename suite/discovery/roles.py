"""Which roles a model's states and parameters play, read off the equations, the units and the record."""

from __future__ import annotations

import re

import numpy as np
import sympy

from suite import expressions
from suite.model import Model
from suite.record import Record

CELSIUS = ("c", "degc", "celsius", "°c")
KELVIN = ("k", "kelvin")
ANGLE = re.compile(r"(th|theta|phi|psi|alpha|beta|gamma|angle)\d*\Z")
ASIDE, CROSSINGS = 0.1, 3  # of its range away from zero, and how often on the other side: a state that has a zero


def centred(model: Model, record: Record) -> set[str]:
    """The measured states that change sides of their zero again and again, by at least a tenth of their range."""
    found = set()
    for j, output in enumerate(model.outputs.values()):
        y = record.y[~np.isnan(record.y[:, j]), j]
        far = y[np.abs(y) > ASIDE * np.ptp(y)] if len(y) else y
        if np.count_nonzero(np.diff(np.sign(far))) >= CROSSINGS:
            found.add(output.equation.strip())
    return found


def stands_in(model: Model, name: str) -> str | None:
    """The first suspect equation, else the first output, that the parameter stands in."""
    s = expressions.symbol(name)
    order = list(model.states)
    rates = [e for e in model.suspects if s in model.rates[order.index(e)].free_symbols]
    outputs = [o for o, e in zip(model.outputs, model.output_expressions, strict=True) if s in e.free_symbols]
    return next(iter([*rates, *outputs]), None)


def level(model: Model, equation: str) -> str | None:
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


def sources(model: Model, equation: str) -> list[str]:
    """The other states among which the model moves what this one holds: a part of one rate stands in another with the
    other sign, directly or from state to state. Positions and their rates hold nothing.
    """
    order = list(model.states)
    moving = {*model.definitions, *(model.states[p].strip() for p in model.definitions)}
    if equation in moving:
        return []
    parts = [
        set() if name in moving else set(sympy.Add.make_args(sympy.expand(rate)))
        for name, rate in zip(order, model.rates, strict=True)
    ]
    reached, waiting = {equation}, [equation]
    while waiting:
        own = {-part for part in parts[order.index(waiting.pop())]}
        fresh = [name for name, others in zip(order, parts, strict=True) if name not in reached and own & others]
        reached.update(fresh)
        waiting += fresh
    return [name for name in order if name in reached and name != equation]


def connected(model: Model, equation: str) -> set[str]:
    """The states in a rate, and the position or the rate of each: what acts there already."""
    rate = model.rates[list(model.states).index(equation)]
    inside = {name for name in model.states if expressions.symbol(name) in rate.free_symbols} | {equation}
    pairs = [{p, model.states[p].strip()} for p in model.definitions]
    return inside.union(*(pair for pair in pairs if pair & inside))


def is_angle(model: Model, state: str) -> bool:
    """Whether a position is an angle: by its unit, by its output, or by its name."""
    unit = model.units.get(state)
    if unit is not None:
        return unit.strip().lower() in ("rad", "radian", "radians")
    turning = any(output.angle and output.equation.strip() == state for output in model.outputs.values())
    return turning or bool(ANGLE.match(state))


def kelvin(model: Model, equation: str, level: str | None) -> float | None:
    """What to add for kelvin if this state is a temperature (0 or 273.15), None if it is none.

    The unit of the level decides; without a unit, a state named T, T1, temp... is one, in kelvin if its level or
    first value is above 200.
    """
    parameter = model.parameters.get(level) if level else None
    unit = (parameter.unit or "").strip().lower() if parameter else ""
    unit = unit or model.units.get(equation, "").strip().lower()
    if unit in CELSIUS:
        return 273.15
    if unit in KELVIN:
        return 0.0
    if not re.match(r"(T\d*$|T_|temp)", equation):
        return None
    value = parameter.value if parameter else (model.initial[equation].value if equation in model.initial else 0.0)
    return 0.0 if value > 200 else 273.15
