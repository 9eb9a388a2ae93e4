"""States that the outputs read directly, and those that follow from them by differentiation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import sympy

from suite import along, expressions
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


def read_by(model: Model) -> dict[str, str]:
    """The output that reads each state by itself, by state: h = a + b x with a and b free of the states."""
    symbols = {expressions.symbol(name): name for name in model.states}
    found: dict[str, str] = {}
    for output, h in zip(model.outputs, model.output_expressions, strict=True):
        inside = [symbol for symbol in symbols if symbol in h.free_symbols]
        if len(inside) == 1 and not sympy.diff(h, inside[0]).free_symbols & set(symbols):
            found.setdefault(symbols[inside[0]], output)
    return found


def readings(model: Model, record: Record) -> dict[str, Array]:
    """The states that are read directly, each (N,), NaN where its sensor was not read."""
    outputs, states = list(model.outputs), list(model.states)
    h0, H = along.outputs(model, record, np.zeros((len(record), len(states))))
    pairs = {state: (outputs.index(output), states.index(state)) for state, output in read_by(model).items()}
    return {state: (record.y[:, j] - h0[:, j]) / H[:, j, i] for state, (j, i) in pairs.items()}


def derivative_of(model: Model) -> dict[str, str]:
    """The state whose rate each state is, by state, where that is a definition: p' = v gives v: p."""
    at: dict[sympy.Expr, str] = {expressions.symbol(name): name for name in model.states}
    return {at[rate]: name for name, rate in zip(model.states, model.rates, strict=True) if name in model.definitions}
