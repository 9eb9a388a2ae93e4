"""Candidate terms as columns along a path: what regressions work on, and which terms are one function there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import sympy

from suite import expressions
from suite.case import Missing
from suite.discovery.library import Term, candidates
from suite.effect import Effect, Inner
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

SAME = 1e-6  # 1 - cos^2 of two columns below which they are one function on this path


def in_rates(model: Model, effects: Mapping[str, Effect]) -> list[Term]:
    """The candidates that act in a rate; those elsewhere leave no column in a rate's error."""
    found = candidates(model, effects)
    return [term for term in found if term.equation in model.states and getattr(term, "place", "rate") == "rate"]


def column(model: Model, term: Term, record: Record, x: Array) -> Array | None:
    """A term along the states x (N, n), (N,): coefficients 1, inner scales at their start; None for one that needs a
    state which the model lacks.
    """
    names = {*model.states, *model.parameters, *model.inputs}
    try:
        shape = expressions.parse(term.text, names | set(term.names), f"effect {term.effect.id}")
    except Exception:  # a term of an added state does not parse in the model's names
        return None
    place = dict(zip(model.states, x.T, strict=True)).get(term.variable, record.t)
    numbers = dict(zip(model.parameters, model.values.tolist(), strict=True)) | dict.fromkeys(term.coefficients, 1.0)
    numbers |= {name: _start(inner, place, record) for name, inner in term.inner.items()}
    shape = shape.subs({expressions.symbol(name): value for name, value in numbers.items()})
    order = [expressions.symbol(name) for name in (*model.states, *model.inputs, "t")]
    if not shape.free_symbols <= set(order):
        return None
    with np.errstate(all="ignore"):
        values = sympy.lambdify(order, shape, "numpy")(*x.T, *record.u.T, record.t)
    filled = np.broadcast_to(np.asarray(values, dtype=np.float64), (len(record),)).copy()
    return filled if np.isfinite(filled).all() else None


def _start(inner: Inner, place: Array, record: Record) -> float:
    """An inner scale at its start, in the units of this path; `place` (N,) is the variable of the term."""
    low, spread = float(place.min()), float(np.ptp(place)) or 1.0
    length = float(record.t[-1] - record.t[0])
    units = {"spread": spread, "frequency": 2.0 * np.pi / length, "time": length, "step": float(np.median(record.dt))}
    return low + inner.start * spread if inner.of == "range" else inner.start * units.get(inner.of, 1.0)


def look_alikes(
    model: Model, effects: Mapping[str, Effect], missing: Sequence[Missing], record: Record, x: Array
) -> set[str]:
    """The ids of all effects that are, in the equation of a missing one, the same function on the true path x."""
    found: set[str] = set()
    # Each effect alone, since the library keeps only the first of two terms of one shape.
    terms = [term for name, effect in effects.items() for term in in_rates(model, {name: effect})]
    for entry in missing:
        own = [term for term in terms if (term.effect.id, term.equation) == (entry.effect, entry.equation)]
        for term in terms:
            if term.equation == entry.equation and any(_one_function(model, term, mine, record, x) for mine in own):
                found.add(term.effect.id)
    return found


def _one_function(model: Model, a: Term, b: Term, record: Record, x: Array) -> bool:
    u, v = column(model, a, record, x), column(model, b, record, x)
    if u is None or v is None or len(a.inner) != len(b.inner):
        return False
    lengths = float(u @ u) * float(v @ v)
    return lengths > 0 and 1.0 - float(u @ v) ** 2 / lengths < SAME
