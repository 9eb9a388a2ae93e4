"""The contract of a metric: what the judge makes of an estimate beside its own numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from suite.case import Case, Truth
from suite.estimator import Estimate
from suite.record import Record


@dataclass(frozen=True)
class Judged:
    """What a metric sees of one cell: the case, the record with its prior, the truth (None where the case is
    measured), the estimate, whose x is finite, and whether the method is a "filter" or a "smoother".
    """

    case: Case
    record: Record
    truth: Truth | None
    estimate: Estimate
    kind: Literal["filter", "smoother"]


@dataclass(frozen=True)
class Metric:
    """A number of every row, under `name`; `sentence` says what it means, `better` where good values lie.

    `value` returns None where the metric does not apply; what it raises is stored with the row, which keeps its other
    numbers.
    """

    name: str
    sentence: str
    value: Callable[[Judged], float | None]
    better: Literal["lower", "higher", "one", "neither"] = "lower"
