"""What discovery says, as data: the command line prints it, the report draws it, nothing here computes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Kind = Literal["missing_effect", "adequate", "ambiguous", "unexplained"]


@dataclass(frozen=True)
class Comparison:
    """A model beside a record: the free-run simulation Y (N, outputs), the noise sd of each output, and in numbers
    by output the error (RMSE), the fit in percent of the output's variation; `worst` intervals (run, first, last time)
    and a sentence that says where it fails. `over_all`: of an excerpt, whether the numbers are of the whole record.
    """

    Y: Array
    sigma: Array
    error: Mapping[str, float]
    fit: Mapping[str, float]
    worst: tuple[tuple[int, float, float], ...] = ()
    sentence: str = ""
    over_all: bool = False


@dataclass(frozen=True)
class Discrepancy:
    """The smoothed model error: x (N, n) smoothed states, d (N, n) in rate units with standard deviation d_sd (N, n),
    zero where an equation is a definition; `variable` the state against which it is best ordered, `equation` where it
    is largest, `ratio` the correlation ratio (0..1) of d against that variable over bins; `values` (N,) are the
    variable's samples, `ratios` the correlation ratios of all that was tried. Where no filter stayed finite, d is zero
    and d_sd infinite.
    """

    x: Array
    d: Array
    d_sd: Array
    equation: str
    variable: str
    ratio: float
    values: Array | None = None
    ratios: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Coefficient:
    """A coefficient with its standard deviation, and its unit where the model has units."""

    value: float
    sd: float
    unit: str | None = None


@dataclass(frozen=True)
class Named:
    """One effect in one equation, with its term as text and its fitted coefficients (inner scales among them)."""

    effect: str
    equation: str
    term: str
    coefficients: Mapping[str, Coefficient]


@dataclass(frozen=True)
class Candidate:
    """A hypothesis that was refitted: its effects, its share of the weight, its criterion (EBIC, smaller is better),
    its error by output, and delta^2: how far the best hypothesis' noise-free output is from anything it can produce.
    """

    effects: tuple[Named, ...]
    weight: float
    criterion: float
    error: Mapping[str, float]
    separation: float | None = None
    curve: Array | None = None


@dataclass(frozen=True)
class Verdict:
    """What is missing and how sure that is. `to_json` gives the stable object of the command line."""

    verdict: Kind
    sentence: str
    effects: tuple[Named, ...]
    weight: float
    plausible: tuple[Candidate, ...]
    detection: Mapping[str, float]
    smallest_detectable: Mapping[str, float]
    error: Mapping[str, Any]
    parameters: Mapping[str, Mapping[str, float]]
    seconds: float
    advice: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The object of `diagnose --json`, fields as documented."""
        return {
            "schema": 1,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "effects": [
                {
                    "effect": named.effect,
                    "equation": named.equation,
                    "term": named.term,
                    "coefficients": {
                        name: {"value": c.value, "sd": c.sd, **({"unit": c.unit} if c.unit else {})}
                        for name, c in named.coefficients.items()
                    },
                }
                for named in self.effects
            ],
            "weight": self.weight,
            "plausible": [
                {
                    "effects": [{"effect": named.effect, "equation": named.equation} for named in candidate.effects],
                    "weight": candidate.weight,
                    "separation": candidate.separation,
                }
                for candidate in self.plausible
            ],
            "detection": dict(self.detection),
            "smallest_detectable": dict(self.smallest_detectable),
            "error": dict(self.error),
            "parameters": {name: dict(entry) for name, entry in self.parameters.items()},
            "advice": list(self.advice),
            "seconds": self.seconds,
        }


@dataclass(frozen=True)
class Step:
    """One round of the loop: the model as it stood, how it compared (on the fitted record and on held-out data), the
    smoothed discrepancy, whiteness (autocorrelation of the residual by output, from lag 1), and the verdict.
    """

    model: Model
    comparison: Comparison
    held_out: Mapping[str, float]
    discrepancy: Discrepancy | None
    autocorrelation: Mapping[str, Array]
    verdict: Verdict | None


@dataclass(frozen=True)
class Ledger:
    """The whole loop on one record: the steps (the last has the final model) and the judgement in a sentence."""

    record: Record
    steps: tuple[Step, ...]
    sentence: str
    history: tuple[Mapping[str, Any], ...] = field(default=())
