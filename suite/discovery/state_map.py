"""The model error over bins of its variable and over cells of the two states that matter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from suite import expressions
from suite.discovery.result import Discrepancy
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]

BINS = 24
CELLS = (6, 24)
FEW = 5  # samples below which a bin or a cell says little


@dataclass(frozen=True)
class Bins:
    """d in equally wide bins of its variable: edges (B + 1,), mean and its standard deviation sd (B,), NaN where a bin
    is empty, count (B,). The samples of one passage err together, so the deviation falls with passages, not samples.
    """

    edges: Array
    mean: Array
    sd: Array
    count: Counts


@dataclass(frozen=True)
class Map:
    """Mean d in cells of the states x and y: edges (A + 1,), (B + 1,), mean (A, B), NaN where never visited, count."""

    x: str
    y: str
    x_edges: Array
    y_edges: Array
    mean: Array
    count: Counts


def bins(found: Discrepancy, v: Array, record: Record, j: int, most: int = BINS) -> Bins:
    """d of state number j in up to `most` bins of its variable v (N,)."""
    known = np.isfinite(v) & np.isfinite(found.d[:, j])
    count = int(np.clip(known.sum() // FEW, 1, most))
    edges = np.linspace(v[known].min(), v[known].max(), count + 1) if known.any() else np.zeros(count + 1)
    if edges[0] == edges[-1]:
        edges = edges[0] + np.linspace(0.0, abs(edges[0]) or 1.0, count + 1)
    place = np.clip(np.searchsorted(edges, v, side="right") - 1, 0, count - 1)
    held = place[known]
    samples = np.bincount(held, minlength=count)
    full = np.maximum(samples, 1)
    mean = np.bincount(held, found.d[known, j], count) / full
    variance = np.bincount(held, found.d_sd[known, j] ** 2, count) / full
    passages = np.zeros(count)
    for first, last in pairwise(record.bounds.tolist()):
        own = place[first:last]
        enters = np.concatenate([[True], own[1:] != own[:-1]])
        passages += np.bincount(own[enters], minlength=count)
    empty = samples == 0
    sd = np.sqrt(variance / np.maximum(passages, 1))
    return Bins(edges, np.where(empty, np.nan, mean), np.where(empty, np.nan, sd), samples)


def axes(model: Model, found: Discrepancy) -> tuple[str, str] | None:
    """The two states that order d best, in the model's order; the equation's own breaks ties. None with fewer than two
    states that any equation contains.
    """
    used = set().union(*(rate.free_symbols for rate in model.rates))
    states = [name for name in model.states if expressions.symbol(name) in used]
    if len(states) < 2:
        return None
    told = {name: found.ratios.get(name, 0.0) for name in states}
    preferred = sorted(states, key=lambda name: (name != found.variable, -told[name], name != found.equation))
    first, second = preferred[:2]
    return (first, second) if states.index(first) < states.index(second) else (second, first)


def state_map(model: Model, found: Discrepancy) -> Map | None:
    """Mean d over two states in about as many cells as give each a dozen samples."""
    pair = axes(model, found)
    if pair is None:
        return None
    states = list(model.states)
    a, b = (found.x[:, states.index(name)] for name in pair)
    d = found.d[:, states.index(found.equation)]
    known = np.isfinite(a) & np.isfinite(b) & np.isfinite(d)
    a, b, d = a[known], b[known], d[known]
    cells = int(np.clip(np.sqrt(len(d) / 12), *CELLS))
    total, ea, eb = np.histogram2d(a, b, bins=cells, weights=d)
    count = np.histogram2d(a, b, bins=(ea, eb))[0].astype(np.int64)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return Map(*pair, ea, eb, mean, count)
