"""The stored rows as one comparison: who is in the race, under which conditions, and how well each did.

A method is an estimator with a variant, a condition a case with a noise level. Only conditions with a known truth are
judged; reference rows stand beside, apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from suite import plugins
from suite.benchmark.ranking import block_ranks
from suite.benchmark.statistics import interval, is_reference, ratios, score

Array = npt.NDArray[np.float64]
Row = Mapping[str, Any]
Condition = tuple[str, float]

ERROR = "state_nrmse"
REFERENCE = ("ekf", "default")
FEW = 6  # cases below which a bootstrap over cases says no more than their range


@dataclass(frozen=True)
class Method:
    """An estimator with a variant; `family` is "estimators" or "baselines", by where its plug-in is ("" where it is
    not installed), `kind` "filter" or "smoother".
    """

    estimator: str
    variant: str
    family: str = ""
    kind: str = "filter"

    @property
    def label(self) -> str:
        """Its name in tables and figures."""
        if self.variant == "default":
            return self.estimator
        return f"tuned {self.estimator}" if self.variant == "tuned" else f"{self.estimator}, {self.variant}"


@dataclass(frozen=True)
class Comparison:
    """The rows of methods, and those of references, by method and condition (rows in the order of the seeds)."""

    rows: Mapping[Method, Mapping[Condition, Sequence[Row]]]
    references: Mapping[Method, Mapping[Condition, Sequence[Row]]]

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Those on which any method has an error against the truth."""
        found = {
            condition
            for table in (*self.rows.values(), *self.references.values())
            for condition, rows in table.items()
            if any(row.get(ERROR) is not None for row in rows)
        }
        return tuple(sorted(found))

    @property
    def cases(self) -> tuple[str, ...]:
        """Cases with a known truth."""
        return tuple(dict.fromkeys(case for case, _ in self.conditions))

    @property
    def reference(self) -> Method | None:
        """The method to whose errors the others' are related: the EKF as shipped."""
        return next((m for m in self.rows if (m.estimator, m.variant) == REFERENCE), None)

    @property
    def seeds(self) -> tuple[int, int]:
        """The least and the largest number of seeds of a method under a condition."""
        judged = set(self.conditions)
        counts = [len(rows) for table in self.rows.values() for at, rows in table.items() if at in judged]
        return (min(counts), max(counts)) if counts else (0, 0)

    def seeds_of(self, method: Method) -> int:
        """The number of seeds of a method under most conditions."""
        counts = [len(rows) for at, rows in self.of(method).items() if at in set(self.conditions)]
        return int(np.median(counts)) if counts else 0

    def methods(self, variant: str | None = None, **wanted: str) -> list[Method]:
        """Methods in the race, best mean rank first. Of a variant: a method without tuning stands in both lists."""
        tuned = {m.estimator for m in self.rows if m.variant == "tuned"}
        lone = {m for m in self.rows if m.estimator not in tuned and m.variant == "default"}
        chosen = [m for m in self.rows if variant is None or m.variant == variant or (variant == "tuned" and m in lone)]
        chosen = [m for m in chosen if all(getattr(m, key) == value for key, value in wanted.items())]
        means = self.ranks(chosen).mean(axis=1) if chosen and self.conditions else np.zeros(len(chosen))
        order: list[int] = np.argsort(means, kind="stable").tolist()
        return [chosen[i] for i in order]

    def by_seed(self, method: Method, at: Condition, metric: str = ERROR) -> dict[int, float]:
        """A method's scores under a condition by seed, infinite where it failed."""
        table = self._scores.setdefault((method, metric), {})
        if at not in table:
            table[at] = {row["seed"]: score(row, metric) for row in self.of(method).get(at, ())}
        return table[at]

    def of(self, method: Method) -> Mapping[Condition, Sequence[Row]]:
        """The rows of a method or a reference by condition."""
        return self.rows.get(method) or self.references.get(method) or {}

    @cached_property
    def _scores(self) -> dict[tuple[Method, str], dict[Condition, dict[int, float]]]:
        """What `by_seed` has found so far."""
        return {}

    @cached_property
    def _middles(self) -> dict[tuple[Method, str], Array]:
        """Medians over seeds (conditions,) that were asked for so far."""
        return {}

    def _middle(self, method: Method, metric: str) -> Array:
        if (method, metric) not in self._middles:
            found = [self.by_seed(method, at, metric).values() for at in self.conditions]
            self._middles[method, metric] = np.array([float(np.median(list(f) or [np.inf])) for f in found])
        return self._middles[method, metric]

    def medians(self, methods: Sequence[Method], metric: str = ERROR) -> Array:
        """Median scores over seeds, (methods, conditions); infinite where half of the seeds failed or none was run."""
        found = np.array([self._middle(method, metric) for method in methods])
        return found.reshape(len(methods), len(self.conditions))

    def ranks(self, methods: Sequence[Method]) -> Array:
        """Ranks of methods by state error, (methods, cases)."""
        return block_ranks(self.medians(methods), [case for case, _ in self.conditions])

    def ratio(self, method: Method, against: Method, at: Condition, metric: str = ERROR) -> float | None:
        """Median over seeds of a method's error over another's; infinite where it failed, None where the other did."""
        found = ratios(self.by_seed(method, at, metric), self.by_seed(against, at, metric))
        return float(np.median(found)) if len(found) else None

    def case_ratios(self, method: Method, against: Method, metric: str = ERROR) -> Array:
        """The error ratio on each case on which `against` gave a number: the median over the case's noise levels."""
        by_case: dict[str, list[float]] = {}
        for at in self.conditions:
            ratio = self.ratio(method, against, at, metric)
            if ratio is not None:
                by_case.setdefault(at[0], []).append(ratio)
        return np.array([np.median(found) for found in by_case.values()])

    def over_cases(self, method: Method, against: Method, metric: str = ERROR) -> tuple[float, float, float] | None:
        """Median of the case ratios with its 95 % interval from resampled cases; with their range below FEW cases."""
        found = self.case_ratios(method, against, metric)
        if len(found) == 0:
            return None
        return interval(found) if len(found) >= FEW else (float(np.median(found)), found.min(), found.max())

    def counts(self, method: Method) -> dict[str, int]:
        """How its cells ended, by status, measured cases among them."""
        found: dict[str, int] = {}
        for rows in self.of(method).values():
            for row in rows:
                found[row["status"]] = found.get(row["status"], 0) + 1
        return found

    def median_of(self, method: Method, field: str) -> float | None:
        """Median of a number over the cells that ended well, infinities aside."""
        rows = [row for found in self.of(method).values() for row in found if row["status"] == "ok"]
        values = [row[field] for row in rows if field in row]
        fine = [value for value in values if isinstance(value, (int, float)) and np.isfinite(value)]
        return float(np.median(fine)) if fine else None


def compare(rows: Iterable[Row]) -> Comparison:
    """The comparison of stored rows; those of the recovery benchmark are another matter and left out."""
    known = plugins.estimators()
    families = {name: family for family in ("estimators", "baselines") for name in plugins.find(family).loaded}
    race: dict[Method, dict[Condition, list[Row]]] = {}
    references: dict[Method, dict[Condition, list[Row]]] = {}
    for row in rows:
        if row.get("kind") == "recovery":
            continue
        name = row["estimator"]
        kind = known[name].kind if name in known else "filter"
        method = Method(name, row["variant"], families.get(name, ""), kind)
        table = references if is_reference(row) else race
        table.setdefault(method, {}).setdefault((row["case"], row["noise"]), []).append(row)
    return Comparison(race, references)
