"""Candidate terms as columns along a path: what regressions work on, and which terms are one function there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import sympy

from suite import expressions
from suite.case import Missing
from suite.discovery.library import candidates
from suite.discovery.terms import Term
from suite.effect import Effect, Inner
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Name = tuple[str, str]

COLLINEAR = 1e-3  # share of a column that the parameters' columns leave, below which it is a parameter
SAME = 1e-6  # 1 - cos^2 of two columns below which they are one function on this path
TWICE = 1e-10  # ... below which one column stands there twice


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


def named(model: Model, effects: Mapping[str, Effect], record: Record, x: Array) -> dict[Name, Array]:
    """The candidates' columns by (effect, equation); where one effect binds twice in an equation, the first.

    A term whose column is another's, as that of a power at its start, is left out: a regression cannot hold both.
    """
    found: dict[Name, Array] = {}
    for term in sorted(in_rates(model, effects), key=lambda term: len(term.inner)):
        values = column(model, term, record, x)
        if values is None or not values.any():
            continue
        beside = [other for name, other in found.items() if name[1] == term.equation]
        if not any(_proportional(values, other, TWICE) for other in beside):
            found.setdefault((term.effect.id, term.equation), values)
    return found


def disguised(model: Model, record: Record, x: Array, found: Mapping[Name, Array]) -> set[Name]:
    """The candidates that are a free parameter of the model in disguise: the derivatives of their equation's rate by
    the parameters (central differences) explain their column.
    """
    slopes = []
    for j, parameter in enumerate(model.parameters.values()):
        step = 1e-5 * (abs(parameter.value) or 1.0) if parameter.prior_sd > 0 else 0.0
        moved = [model.values + sign * step * np.eye(len(model.values))[j] for sign in (1.0, -1.0)]
        points = zip(record.t, x, record.u, strict=True) if step else ()
        slopes += [[np.subtract(*(model.rate(t, state, u, p) for p in moved)) / (2 * step) for t, state, u in points]]
    by_parameter = np.array([slope for slope in slopes if slope])
    hidden = set()
    for name, values in found.items() if len(by_parameter) else ():
        A = by_parameter[:, :, list(model.states).index(name[1])].T
        A = A / np.maximum(np.sqrt((A**2).sum(axis=0)), 1e-300)
        left = values - A @ np.linalg.lstsq(A, values, rcond=None)[0]
        if np.linalg.norm(left) < COLLINEAR * np.linalg.norm(values):
            hidden.add(name)
    return hidden


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
    return _proportional(u, v, SAME)


def _proportional(u: Array, v: Array, share: float) -> bool:
    """Whether all but a share of the squares of u and v is common."""
    lengths = float(u @ u) * float(v @ v)
    return lengths > 0 and 1.0 - float(u @ v) ** 2 / lengths < share
