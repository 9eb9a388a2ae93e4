"""The free run at other parameter values, quickly: what the sliders show. Nothing is compiled or prepared again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Problem
from suite.discovery.fit import homotopy, prepare
from suite.discovery.frame import Point
from suite.discovery.misfit import frozen
from suite.discovery.noise import noise_variance
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]


class FreeRun:
    """A model beside a record, prepared once; `at` simulates it at given values.

    Unknown initial states are fitted anew at each call, as `misfit.simulate` does.
    """

    def __init__(self, model: Model, record: Record) -> None:
        self.model = model
        self.sigma = np.sqrt(noise_variance(model, record))
        self.runs: list[tuple[Record, Problem]] = [(run, prepare(frozen(model), run)) for run in record.runs]

    def at(self, values: Mapping[str, float]) -> Array:
        """Outputs (N, outputs) at the model's values with some of them changed."""
        model = frozen(self.model.with_values(values))
        return np.concatenate([self._outputs(run, problem, model) for run, problem in self.runs])

    def _outputs(self, run: Record, problem: Problem, model: Model) -> Array:
        start = Point(problem.start.x0, model.values)
        there = problem.on(problem.record, start, model=model)
        point = homotopy(there, start).exact.point if there.free_x0.any() else start
        # Outliers are left out of the fit and a chaotic run is cut for it; the simulation is of the whole run.
        return there.on(run, there.start).run(point, 0.0).Y
