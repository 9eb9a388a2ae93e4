"""What a stored row depends on: the plug-in's sources, the case as numbers, the version. Changed: run it again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import suite
from suite import plugins
from suite.benchmark import references, sources
from suite.benchmark.cells import Cell
from suite.benchmark.recovery import OURS, RIVALS
from suite.case import Case
from suite.errors import DataError

METHODS = (OURS, *RIVALS)


def _digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()[:16]


def plugin(estimator: object) -> str:
    """A hash of the source of an estimator's module and of what that builds on (see `sources`)."""
    return _digest(*sources.closure(type(estimator).__module__))


def measures() -> str:
    """A hash of the modules of the metrics that are plug-ins: a new one is a number that stored rows lack."""
    names = {getattr(metric.value, "__module__", "") for metric in plugins.metrics().values()}
    return _digest(*sorted((name, sources.text(name)) for name in names))


# What a row of the recovery benchmark depends on, as files and folders of the packages.
FINDING = ("suite/discovery", "suite/kernels", "suite/filtering.py", "suite/smoothing.py", "effects")
JUDGING = ("recovery.py", "verdicts.py", "conditions.py", "columns.py")
RIVAL = ("rivals.py", "sparse.py", "better.py")


def finding() -> list[Path]:
    """The files of discovery, its kernels and the library of effects."""
    root = Path(suite.__file__).parent.parent
    parts = [[root / part] if part.endswith(".py") else (root / part).glob("*.py") for part in FINDING]
    return [path for part in parts for path in part]


def method(name: str) -> str:
    """A hash of the source of a method of the recovery benchmark, of its judge and of the library of effects."""
    here = Path(__file__).parent
    paths = finding()
    paths += [here / file for file in (*JUDGING, *(() if name == OURS else RIVAL))]
    texts = sorted((path.name, path.read_text(encoding="utf-8")) for path in paths)
    versions = [version("pysindy")] if "pysindy" in name and find_spec("pysindy") else []
    filters = [plugin(plugins.estimators()[used]) for used in ("generalized-ie", "random-walk-smoother")]
    return _digest(name, texts, sorted(plugins.effects()), versions, filters if name != OURS else [])


def case(entry: Case, data: Path | None) -> str:
    """A hash of the models and the experiment, or of the measured record; inputs count by their values."""
    models = [repr(entry.deficient), repr(entry.truth), entry.held, repr(entry.missing)]
    if entry.measured is not None:
        try:
            record = entry.measured(data)
        except DataError:
            return _digest(*models, "absent")
        return _digest(*models, _array(record.t), _array(record.u), _array(record.y), record.starts)
    e = entry.experiment
    assert e is not None
    times = np.arange(0.0, e.duration, e.dt)
    inputs = {name: _array(np.array([f(float(t)) for t in times])) for name, f in e.inputs.items()}
    return _digest(*models, e.duration, e.dt, e.x0, inputs, dict(e.every))


def _array(values: Any) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


class Keys:
    """The key of every cell and every tuning, each hash computed once."""

    def __init__(
        self, data: Path | None, tuned_at: float | None = None, tuned_as: Mapping[str, str] | None = None
    ) -> None:
        self.tuned_at = tuned_at
        self.tuned_as = tuned_as or {}
        self.plugin = cache(lambda name: method(name) if name in METHODS else plugin(references.methods()[name]))
        self.case = cache(lambda name: case(plugins.cases()[name], data))
        self.measures = cache(measures)

    def tuning(self, name: str, noise: float, estimator: str) -> str:
        """The key of the tuned values of an estimator on a case for a noise level."""
        noise, estimator = self.tuning_noise(noise), self.tuner(estimator)
        return _digest("tuning", name, noise, estimator, self.plugin(estimator), self.case(name), suite.__version__)

    def tuning_noise(self, noise: float) -> float:
        """The noise level at which the values for a level are found."""
        return noise if self.tuned_at is None else self.tuned_at

    def tuner(self, estimator: str) -> str:
        """The estimator whose tuned values serve one."""
        return self.tuned_as.get(estimator, estimator)

    def cell(self, cell: Cell) -> str:
        """The key of a cell."""
        tuned = self.tuning(cell.case, cell.noise, cell.estimator) if cell.variant == "tuned" else ""
        versions = (self.plugin(cell.estimator), self.case(cell.case), suite.__version__)
        judged = () if cell.estimator in METHODS else (self.measures(),)
        return _digest(cell.label, tuned, *versions, *judged)
