"""What a computing process of the server does: each function is one request, and answers with JSON text.

Models come as text and are read by the whitelist of the model file; data come as files that the server wrote itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

from suite.discovery import misfit
from suite.discovery.discrepancy import discrepancy
from suite.discovery.fit import prepare
from suite.discovery.misfit import frozen
from suite.discovery.where import where
from suite.errors import DataError, InputError
from suite.model import Model, Parameter
from suite.model_text import to_toml
from suite.readers import read_table
from suite.web import bench_tasks, discovery_tasks, example_tasks
from suite.web.free_run import FreeRun
from suite.web.opened import Files, both, known, renamed
from suite.web.payloads import text, trace
from suite.web.step_payload import step

Tell = Callable[[str], None]

CHEAP = 3000  # samples up to which a comparison also smooths the model error

examples, example = example_tasks.examples, example_tasks.example
analyse, report = discovery_tasks.analyse, discovery_tasks.report
bench, cell = bench_tasks.bench, bench_tasks.cell


def model(source: str, tell: Tell) -> str:
    """What the page shows of a model's text."""
    found = known(source)
    return text(
        {
            "name": found.name,
            "states": [
                {"name": name, "equation": rate, "definition": name in found.definitions}
                for name, rate in found.states.items()
            ],
            "parameters": [_parameter(name, entry) for name, entry in found.parameters.items()],
            "inputs": list(found.inputs),
            "outputs": [
                {"name": name, "equation": output.equation, "sigma": output.sigma}
                for name, output in found.outputs.items()
            ],
            "latex": found.latex(),
        }
    )


def _parameter(name: str, entry: Parameter) -> Mapping[str, object]:
    low, high = entry.bounds
    sd = entry.prior_sd
    return {
        "name": name, "value": entry.value, "sd": sd, "fixed": entry.fixed, "low": low, "high": high,
        "unit": entry.unit,
    }  # fmt: skip


def data(path: str, name: str, tell: Tell) -> str:
    """The columns of a file that came in; refuses what is no table."""
    try:
        return text({"columns": list(read_table(path).columns)})
    except DataError as error:
        raise renamed(error, [(path, name)]) from None


def compare(source: str, files: Files, tell: Tell) -> str:
    """The model beside the data at its own values."""
    found, record = both(source, tuple(files))
    compared = misfit.compare(found, record)
    error = None
    if len(record) <= CHEAP:
        # Nothing is fitted, so a record too short to determine the parameters will do.
        problem = prepare(frozen(found), record)
        error = discrepancy(problem, problem.start)
        compared = replace(compared, sentence=f"{compared.sentence} {where(error, record, found)}")
    return text(step(found, record, compared, error))


def simulate(source: str, files: Files, values: Mapping[str, float], tell: Tell) -> str:
    """The free run at other values of some parameters."""
    run = _free_run(source, tuple(files))
    found, record = both(source, tuple(files))
    changed(found, values)
    compared = misfit.compare(found, record, run.at(values), run.sigma)
    return text(
        {
            "outputs": [
                {"name": name, "fit": compared.fit[name], "error": compared.error[name],
                 **trace(record, compared.Y[:, j])}
                for j, name in enumerate(found.outputs)
            ]
        }
    )  # fmt: skip


def values(source: str, values: Mapping[str, float], tell: Tell) -> str:
    """The model's text with other start values."""
    return text({"model": to_toml(changed(known(source), values))})


def changed(found: Model, values: Mapping[str, float]) -> Model:
    """The model at other values; refuses what is no parameter or outside its bounds."""
    for name, value in values.items():
        if name not in found.parameters:
            raise InputError(f"{name!r:.60} is no parameter of the model; it has {', '.join(found.parameters)}")
        low, high = found.parameters[name].bounds
        if not math.isfinite(value) or not low <= value <= high:
            raise InputError(f"{name} = {value:g}: expected a number from {low:g} to {high:g}; choose one of them")
    return found.with_values(values)


@lru_cache(maxsize=4)
def _free_run(source: str, files: tuple[tuple[str, str], ...]) -> FreeRun:
    return FreeRun(*both(source, files))
