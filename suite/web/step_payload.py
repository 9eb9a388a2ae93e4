"""A model beside its record as the page draws it: outputs, residuals, the smoothed model error, correlations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery import misfit, whiteness
from suite.discovery.result import Comparison, Discrepancy
from suite.discovery.variable import samples, variables
from suite.model import Model
from suite.quantities import compact, unit
from suite.record import Record
from suite.report.canvas import timeline
from suite.web.payloads import digits, kept_samples, runs, trace

Array = npt.NDArray[np.float64]


def step(
    model: Model,
    record: Record,
    compared: Comparison,
    found: Discrepancy | None,
    held_out: Mapping[str, float] | None = None,
    autocorrelation: Mapping[str, Array] | None = None,
) -> dict[str, Any]:
    """The object STEP; `autocorrelation` is that of the plain residual where none is given."""
    e = misfit.residual(model, record, compared.Y, compared.sigma)
    outputs = list(model.outputs)
    r = autocorrelation or whiteness.whiteness(record, e, outputs)
    crossed = whiteness.cross_correlation(record, e, outputs, list(model.inputs))
    return {
        "time": {"label": model.time or "t", "unit": model.units.get("t")},
        "runs": runs(record, record.names),
        "outputs": [_output(model, record, compared, e, name) for name in outputs],
        "sentence": compared.sentence,
        "held_out": dict(held_out or {}),
        "discrepancy": None if found is None else _discrepancy(model, record, found),
        "whiteness": [
            {"output": name, "r": values, "band": whiteness.band(record, outputs.index(name))}
            for name, values in r.items()
        ],
        "cross": [
            {"output": output, "input": name, "lags": entry.lags, "r": entry.r, "band": entry.band}
            for output, own in crossed.items()
            for name, entry in own.items()
        ],
    }


def _output(model: Model, record: Record, compared: Comparison, e: Array, name: str) -> dict[str, Any]:
    j = list(model.outputs).index(name)
    _, offsets = timeline(record)
    # The worst intervals of this output alone.
    alone = replace(model, outputs={name: model.outputs[name]})
    column = replace(record, y=record.y[:, j : j + 1])
    own = misfit.compare(alone, column, compared.Y[:, j : j + 1], compared.sigma[j : j + 1])
    return {
        "name": name,
        "unit": model.units.get(model.outputs[name].equation.strip()),
        "fit": compared.fit[name],
        "error": compared.error[name],
        "sigma": float(compared.sigma[j]),
        "measured": trace(record, record.y[:, j]),
        "model": trace(record, compared.Y[:, j]),
        "residual": trace(record, e[:, j]),
        "worst": [[first + offsets[run], last + offsets[run]] for run, first, last in own.worst],
    }


def _discrepancy(model: Model, record: Record, found: Discrepancy) -> dict[str, Any]:
    names = list(model.states)
    j = names.index(found.equation)
    kept, run = kept_samples(record, found.d[:, j])
    t, _ = timeline(record)
    plain, rates, clock = variables(model, record, found.x, found.d, found.equation)
    known = plain | rates | clock | {found.variable: samples(model, record, found)}
    ranked = sorted(known, key=lambda name: -found.ratios.get(name, 0.0))
    suspects = list(model.suspects)
    return {
        "equation": found.equation,
        "variable": found.variable,
        "ratio": found.ratio,
        "equations": suspects,
        "variables": [{"name": name, "ratio": found.ratios.get(name)} for name in ranked],
        "units": _units(model),
        "t": digits(t[kept]),
        "run": run,
        "d": {name: digits(found.d[kept, names.index(name)]) for name in suspects},
        "sd": {name: digits(found.d_sd[kept, names.index(name)]) for name in suspects},
        "values": {name: digits(known[name][kept]) for name in ranked},
    }


def _units(model: Model) -> dict[str, str]:
    """The units that the model states: of states, inputs and t by name, and of a state's rate by its name and '."""
    units = dict(model.units)
    for name in model.states:
        own, time = unit(model.units.get(name, "")), unit(model.units.get("t", ""))
        if own is not None and time is not None:
            units[f"{name}'"] = compact(own / time)
    return units
