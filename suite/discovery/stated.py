"""What is said of a very long record beside its excerpt: errors over all samples, and where else a model fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from suite.discovery import words
from suite.discovery.fit import Hypothesis
from suite.discovery.identify import Search
from suite.discovery.result import Comparison
from suite.discovery.whole import Survey, survey
from suite.record import Record, Whole

LOST = 1.5  # times the error in the pieces: where a simulation of all samples has more, it has lost its way
BEYOND = 2.0  # times the mean squared error of the worst piece of the excerpt: what is worth saying of another piece


def over_all(found: Search, named: Hypothesis, error: Mapping[str, Any]) -> dict[str, Any]:
    """The errors of `outcome.errors` with those before and after over the whole record in their place, where the
    simulation of all samples does not lose its way; beside them as `whole` where it stays finite.
    """
    surveys = _surveys(found, named)
    if surveys is None:
        return dict(error)
    names = list(found.problem.model.outputs)
    before, after = (dict(zip(names, part.error.tolist(), strict=True)) for part in surveys)
    whole = {"whole": {"before": before, "after": after}} if all(part.finite for part in surveys) else {}
    kept = {"before": before, "after": after} if holds(surveys[1], error["after"], names) else {}
    return {**error, **kept, **whole}


def advice(found: Search, named: Hypothesis, error: Mapping[str, Any]) -> tuple[str, ...]:
    """What was done with a very long record, and what its excerpt does not show; () for any other."""
    record = found.problem.record
    if record.whole is None:
        return ()
    surveys = _surveys(found, named)
    whole = error.get("whole", {}).get("after") == error["after"]
    said = words.excerpt(len(record.whole.record), len(record), len(record.whole.first), whole)
    if surveys is None:
        return (f"{said} The plant forgets where it started, so no simulation spans the record.",)
    if not all(part.finite for part in surveys):
        return (f"{said} A simulation of all samples leaves the finite numbers.",)
    if not whole:
        said = f"{said} In one simulation of all samples the error is {words.numbers(error['whole']['after'])}."
    return (said, *_beyond(record.whole, surveys[1]))


def over_base(found: Search, error: Mapping[str, Any]) -> Survey | None:
    """The base model over the whole record, where the stated errors are of that."""
    surveys = _surveys(found, found.base)
    if surveys is None or error["before"] != error.get("whole", {}).get("before"):
        return None
    return surveys[0]


def sentence(record: Record, found: Comparison) -> str:
    """What a comparison says of an excerpt; "" for any other record."""
    if record.whole is None:
        return ""
    return words.excerpt(len(record.whole.record), len(record), len(record.whole.first), found.over_all)


def holds(found: Survey, inside: Mapping[str, float], names: Sequence[str]) -> bool:
    """Whether a simulation of all samples is as near to the data as those of the pieces are, about."""
    return found.finite and all(value <= LOST * inside[name] for name, value in zip(names, found.error, strict=True))


def _beyond(whole: Whole, found: Survey) -> tuple[str, ...]:
    """Where a model fails more than in any piece of the excerpt."""
    mine = np.isin(found.first, whole.first)
    k = int(np.nanargmax(np.where(mine, -np.inf, found.square)))
    if mine[k] or found.square[k] <= BEYOND * np.nanmax(found.square[mine]):
        return ()
    first, last = whole.record.t[[found.first[k], found.last[k] - 1]]
    return (
        f"From t = {first:.4g} to {last:.4g}, which is in none of the pieces, the model fails more than in any of "
        f"them: its error is {found.square[k] ** 0.5:.2g} times the noise.",
    )


def _surveys(found: Search, named: Hypothesis) -> tuple[Survey, Survey] | None:
    """The base model and the named hypothesis over the whole record; None where no simulation could span it."""
    problem = found.problem
    whole = problem.record.whole
    if whole is None or len(problem.record.starts) > len(whole.first):
        return None
    known: dict[frozenset[int], Survey] = found.__dict__.setdefault("_surveys", {})
    for hypothesis in (found.base, named):
        key, p = frozenset(hypothesis.active), hypothesis.exact.point.p
        if key not in known:
            known[key] = survey(problem, p, hypothesis.active, whole.record, length=whole.length)
    return known[frozenset(found.base.active)], known[frozenset(named.active)]
