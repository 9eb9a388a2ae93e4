"""Stored results of the benchmark for the page: the matrix, and a cell computed again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from suite import plugins
from suite.benchmark import hashes, table
from suite.benchmark.cells import experiment
from suite.benchmark.statistics import is_reference
from suite.benchmark.store import Store
from suite.case import Case, Truth
from suite.errors import InputError
from suite.estimator import Estimate
from suite.record import Record
from suite.web.payloads import digits, kept_samples, text, trace

Tell = Callable[[str], None]
Array = npt.NDArray[np.float64]
Row = Mapping[str, Any]

BETTER = {
    "ok": "high", "state_nrmse": "low", "ratio": "low", "d_nrmse": "low", "parameter_worst": "low", "named": "high",
    "step_us": "low",
}  # fmt: skip
UNITS = {"step_us": "µs"}
PARTS = ("case", "noise", "estimator", "variant")


def bench(store: str, tell: Tell) -> str:
    """One line a case, noise, estimator and variant, as `bench table` prints them."""
    rows = _rows(store)
    columns = [
        {
            "key": column.field, "label": column.heading, "unit": UNITS.get(column.field),
            "better": BETTER.get(column.field), "meaning": column.meaning,
        }
        for column in table.COLUMNS
    ]  # fmt: skip
    fields = [column.field for column in table.COLUMNS]
    lines = [{**{field: line.get(field) for field in fields}, "key": _key(line)} for line in table.lines(rows)]
    count = len({row["case"] for row in rows})
    source = f"{len(rows)} cells of {count} cases in {Path(store).name}"
    return text({"columns": columns, "rows": lines, "source": source})


def cell(store: str, key: str, tell: Tell) -> str:
    """The trajectories of one line of the matrix, computed again for its first seed that ended well."""
    tell("Reading the stored results")
    rows = [row for row in _rows(store) if _key(row) == key]
    if not rows:
        raise InputError(f"no line {key!r:.80} in {Path(store).name}; load the matrix anew")
    row = next((row for row in rows if row["status"] == "ok"), None)
    if row is None:
        reason = next((row["reason"] for row in rows if row.get("reason")), rows[0]["status"])
        raise InputError(f"no seed of it ended well, so there is nothing to draw: {reason}")
    if is_reference(row):
        raise InputError(f"{row['estimator']} is a reference and knows the truth; it has no estimate to draw")
    case, estimator = plugins.cases().get(row["case"]), plugins.estimators().get(row["estimator"])
    if case is None or estimator is None:
        raise InputError(f"{row['case'] if case is None else row['estimator']} is not installed here")
    if row.get("case_hash") not in (None, hashes.case(case, None)):
        raise InputError(f"the case {case.name} has changed since it was run; run it again to see it")
    tell(f"Computing {row['estimator']} on {row['case']} again, seed {row['seed']}")
    record, truth = experiment(case, row["noise"], int(row["seed"]), None)
    try:
        estimate = estimator.estimate(case.deficient, record, **row["tuning"])
    except Exception as error:  # it went well when it was run; a plug-in changed since may fail in any way
        raise InputError(f"{row['estimator']} failed this time: {type(error).__name__}: {error}") from None
    title = f"{case.name}, noise {100 * row['noise']:g} %: {row['estimator']} ({row['variant']}), seed {row['seed']}"
    return text({"title": title, **trajectories(case, record, truth, estimate)})


def trajectories(case: Case, record: Record, truth: Truth | None, estimate: Estimate) -> dict[str, Any]:
    """States and model errors on common times, thinned by the extremes of all that is drawn."""
    model = case.deficient
    curves = [estimate.x, *([truth.x, truth.d] if truth else []), *([estimate.d] if estimate.d is not None else [])]
    kept = np.unique(np.concatenate([kept_samples(record, values)[0] for block in curves for values in _spiked(block)]))
    states = [
        {
            "name": name,
            "unit": model.units.get(name),
            "truth": digits(truth.x[kept, i]) if truth else [],
            "estimate": digits(estimate.x[kept, i]),
            "sd": _sd(estimate.P, kept, i),
        }
        for i, name in enumerate(model.states)
    ]
    d = [
        {
            "name": name,
            "truth": digits(truth.d[kept, i]) if truth else [],
            "estimate": digits(estimate.d[kept, i]) if estimate.d is not None else [],
            "sd": _sd(estimate.P_d, kept, i) if estimate.d is not None else None,
        }
        for i, name in enumerate(model.states)
        if (truth is not None and truth.d[:, i].any()) or (estimate.d is not None and estimate.d[:, i].any())
    ]
    outputs = [{"name": name, "measured": trace(record, record.y[:, j])} for j, name in enumerate(model.outputs)]
    return {"t": digits(record.t[kept]), "states": states, "d": d, "outputs": outputs}


def _spiked(block: Array) -> list[Array]:
    """Of several curves (N, n) the one that is furthest out at each sample, in units of its own spread."""
    spread = np.nanstd(block, axis=0)
    scaled = (block - np.nanmean(block, axis=0)) / np.where(spread > 0, spread, 1.0)
    filled = np.nan_to_num(scaled, nan=0.0, posinf=0.0, neginf=0.0)
    return [filled[np.arange(len(filled)), np.abs(filled).argmax(axis=1)]]


def _sd(P: Array | None, kept: npt.NDArray[np.int64], i: int) -> list[float | None] | None:
    return None if P is None else digits(np.sqrt(np.maximum(P[kept, i, i], 0.0)))


def _rows(store: str) -> list[dict[str, Any]]:
    """The stored rows of the matrix; those of the recovery benchmark are another matter."""
    with Store(Path(store), must_exist=True) as opened:
        return [row for row in opened.rows() if row.get("kind") != "recovery"]


def _key(line: Row) -> str:
    return json.dumps([line[part] for part in PARTS], separators=(",", ":"))
