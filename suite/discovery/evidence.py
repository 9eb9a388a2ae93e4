"""Where a model fails as one JSON object: the sentence, d over time, its variable and states, correlations."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery import state_map, whiteness
from suite.discovery.discrepancy import discrepancy
from suite.discovery.fit import prepare
from suite.discovery.misfit import frozen, residual
from suite.discovery.result import Comparison, Discrepancy
from suite.discovery.variable import samples
from suite.discovery.where import where
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]

MOST = 2000  # points of a time series


def evidence(model: Model, record: Record, compared: Comparison) -> dict[str, Any]:
    """The object `where` of `compare --json`; the model's parameters are taken as they are."""
    # Nothing is fitted, so a record too short to determine the parameters will do.
    problem = prepare(frozen(model), record)
    found = discrepancy(problem, problem.start)
    return to_json(model, record, compared, found)


def to_json(model: Model, record: Record, compared: Comparison, found: Discrepancy) -> dict[str, Any]:
    """Fields as documented; None where a number does not exist."""
    states, outputs, inputs = list(model.states), list(model.outputs), list(model.inputs)
    j = states.index(found.equation)
    binned = state_map.bins(found, samples(model, record, found), record, j)
    cells = state_map.state_map(model, found)
    e = residual(model, record, compared.Y, compared.sigma)
    r = whiteness.whiteness(record, e, outputs)
    crossed = whiteness.cross_correlation(record, e, outputs, inputs)
    count = int(np.isfinite(e).sum()) // max(len(outputs), 1)
    return {
        "equation": found.equation,
        "variable": found.variable,
        "ratio": found.ratio,
        "ratios": dict(found.ratios),
        "sentence": where(found, record, model),
        "bins": {
            "edges": binned.edges.tolist(), "d": binned.mean.tolist(), "sd": binned.sd.tolist(),
            "count": binned.count.tolist(),
        },
        "map": cells and {
            "x": cells.x, "y": cells.y, "x_edges": cells.x_edges.tolist(), "y_edges": cells.y_edges.tolist(),
            "d": cells.mean.tolist(), "count": cells.count.tolist(), "few": state_map.FEW,
        },
        "series": [
            {
                "run": run, "t": record.t[kept].tolist(), "d": found.d[kept, j].tolist(),
                "sd": found.d_sd[kept, j].tolist(),
            }
            for run, kept in enumerate(_thinned(record, found.d[:, j]))
        ],
        "worst": [{"run": run, "from": first, "to": last} for run, first, last in compared.worst],
        "whiteness": {
            "lags": list(range(1, whiteness.LAGS + 1)),
            "r": {name: values.tolist() for name, values in r.items()},
            "band": {name: whiteness.band(record, k) for k, name in enumerate(outputs)},
            "ljung_box_p": whiteness.ljung_box(r, count, 0),
        },
        "cross_correlation": {
            "lags": list(range(-whiteness.LAGS, whiteness.LAGS + 1)),
            "r": {out: {name: c.r.tolist() for name, c in own.items()} for out, own in crossed.items()},
            "band": {out: {name: c.band for name, c in own.items()} for out, own in crossed.items()},
        },
    }  # fmt: skip


def _thinned(record: Record, values: Array) -> list[npt.NDArray[np.int64]]:
    """Samples of each run to keep, at most MOST in all: the smallest and the largest of each stretch."""
    kept = []
    stretch = -(-2 * len(record) // MOST) if len(record) > MOST else 1
    for first, last in pairwise(record.bounds.tolist()):
        parts = np.split(np.arange(first, last), range(stretch, last - first, stretch))
        ends = [part[pick(values[part])] for part in parts for pick in (np.argmin, np.argmax)]
        kept.append(np.unique(np.array(ends, dtype=np.int64)))
    return kept
