"""What the model error depends on: it is ordered by states, rates, inputs and time, and the best of them is kept."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from suite import expressions
from suite.discovery.engine import Problem
from suite.discovery.result import Discrepancy
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

BINS = 12
CLEARLY = 0.5  # of the variation that the best state or input leaves: what a rate may leave to be preferred
SLOW = 0.25  # the same for time, which orders whatever moves slowly


def ordered(problem: Problem, model: Model, x: Array, d: Array, sd: Array) -> Discrepancy:
    """The discrepancy of states x, errors d and deviations sd, (N, n) each, with its equation and its variable.

    The equation is the one whose error is largest beside its pace; the variable has the highest correlation ratio.
    """
    names, suspects = list(model.states), [list(model.states).index(name) for name in model.suspects]
    scaled = [float(np.mean(d[:, i] ** 2)) / max(problem.weights[i] ** 2, 1e-300) for i in suspects]
    worst = suspects[int(np.argmax(scaled))]
    plain, rates, clock = variables(model, problem.record, x, d, names[worst])
    ratios = {name: correlation_ratio(v, d[:, worst]) for name, v in (plain | rates | clock).items()}
    best = max(plain, key=lambda name: ratios[name]) if plain else "t"
    for others, share in ((rates, CLEARLY), (clock, SLOW)):
        rival = max(others, key=lambda name: ratios[name], default=best)
        if 1.0 - ratios[rival] < share * (1.0 - ratios[best]):
            best = rival
    values = (plain | rates | clock)[best]
    return Discrepancy(x, d, sd, names[worst], best, ratios[best], values, ratios)


def variables(
    model: Model, record: Record, x: Array, d: Array, equation: str
) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Samples (N,) of what d may be ordered by: states and inputs; rates of other states ("x'"); time ("t").

    A state that no rate contains (height in free fall) has no place in a term, and a rate that is a state already
    (p' = v) or the equation's own, of which d is a part, is left out.
    """
    symbols = {name: expressions.symbol(name) for name in model.states}
    used = set().union(*(rate.free_symbols for rate in model.rates))
    plain = {name: x[:, i] for i, name in enumerate(model.states) if symbols[name] in used}
    plain |= {name: record.u[:, j] for j, name in enumerate(model.inputs)}
    own = model.rates[list(model.states).index(equation)].free_symbols
    rates = {
        f"{name}'": slope(record, x[:, i])
        for i, name in enumerate(model.states)
        if name != equation and name not in model.definitions and symbols[name] in own
    }
    return plain, rates, {"t": record.t}


def samples(model: Model, record: Record, found: Discrepancy) -> Array:
    """The samples of a discrepancy's variable, (N,)."""
    if found.values is not None:
        return found.values
    if found.variable in model.states:
        return found.x[:, list(model.states).index(found.variable)]
    if found.variable in model.inputs:
        return record.u[:, list(model.inputs).index(found.variable)]
    return record.t


def slope(record: Record, values: Array) -> Array:
    """Rate of change of values (N,) within each run."""
    spans = pairwise(record.bounds.tolist())
    return np.concatenate([np.gradient(values[a:b], record.t[a:b]) for a, b in spans])


def edges(v: Array) -> Array:
    """Edges of up to 12 equally filled bins of v, with five samples or more in each."""
    known = v[np.isfinite(v)]
    count = int(np.clip(len(known) // 5, 1, BINS))
    return np.unique(np.quantile(known, np.linspace(0, 1, count + 1))) if len(known) else np.zeros(0)


def places(v: Array, bounds: Array) -> npt.NDArray[np.int64]:
    """The bin of each sample; the last bin holds its upper edge too."""
    return np.clip(np.searchsorted(bounds, v, side="right") - 1, 0, len(bounds) - 2).astype(np.int64)


def correlation_ratio(v: Array, d: Array) -> float:
    """The share of d's variance that lies between equally filled bins of v, 0..1."""
    known = np.isfinite(v) & np.isfinite(d)
    v, d = v[known], d[known]
    bounds = edges(v)
    if len(bounds) < 3 or np.var(d) == 0:
        return 0.0
    which = places(v, bounds)
    counts = np.bincount(which, minlength=len(bounds) - 1)
    means = np.bincount(which, d, len(bounds) - 1) / np.maximum(counts, 1)
    return min(float(np.var(means[which])) / float(np.var(d)), 1.0)
