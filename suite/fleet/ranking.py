"""From rows to a ranking and to words: which machines fail most, and what how many of them lack."""

from __future__ import annotations

import math
import os
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from suite.fleet.stored import Brief

FOLLOWS, UNEXPLAINED, FAILED = "follows the model", "fails, not in the library", "could not be judged"
NAMED = 4  # effects that the sentence names one by one


def ranked(briefs: Iterable[Brief]) -> list[Brief]:
    """The judged files, then the others by name: the largest error over noise first, then weight."""
    return sorted(briefs, key=_place)


def _place(brief: Brief) -> tuple[bool, float, float, str]:
    if brief.status != "ok":
        return True, 0.0, 0.0, brief.file
    return False, -brief.ratio, -brief.weight, brief.file


def judged(ranking: Sequence[Brief]) -> Sequence[Brief]:
    """Those with a verdict, which stand first."""
    return ranking[: bisect_left(ranking, True, key=lambda brief: brief.status != "ok")]


def group(brief: Brief) -> tuple[str, bool]:
    """What a machine lacks in words, and whether that is certain or only the most likely of several."""
    if brief.status != "ok":
        return FAILED, True
    if brief.verdict == "adequate":
        return FOLLOWS, True
    if brief.verdict == "unexplained" or not brief.effects:
        return UNEXPLAINED, True
    return plain(brief.effects), brief.verdict == "missing_effect"


def plain(effects: str) -> str:
    """'coulomb_friction@v' as 'coulomb_friction in v'."""
    return effects.replace("@", " in ").replace(" + ", " and ")


def counts(briefs: Iterable[Brief]) -> dict[str, tuple[int, int]]:
    """Machines by what they lack, certain and most likely, the most frequent effect first; the other groups last."""
    found: dict[str, list[int]] = {}
    for brief in briefs:
        name, certain = group(brief)
        found.setdefault(name, [0, 0])[0 if certain else 1] += 1
    order = sorted(found, key=lambda name: (name in (FOLLOWS, UNEXPLAINED, FAILED), -sum(found[name]), name))
    last = [name for name in (UNEXPLAINED, FOLLOWS, FAILED) if name in found]
    return {name: (found[name][0], found[name][1]) for name in [*(n for n in order if n not in last), *last]}


def sentence(briefs: Sequence[Brief]) -> str:
    """'Of 500 machines, 312 follow the model; 120 lack coulomb_friction in v; 9 could not be judged.'"""
    table = counts(briefs)
    effects = {name: count for name, count in table.items() if name not in (FOLLOWS, UNEXPLAINED, FAILED)}
    total, right = len(briefs), sum(table.get(FOLLOWS, (0, 0)))
    certain = Counter({name: sure for name, (sure, _) in effects.items() if sure}).most_common()
    said = [f"{right or 'none'} {'follows' if right in (0, 1) else 'follow'} the model"]
    said += [f"{count} {_lack(count)} {name}" for name, count in certain[:NAMED]]
    if len(certain) > NAMED:
        more = sum(count for _, count in certain[NAMED:])
        said.append(f"{more} {_lack(more)} something else ({len(certain) - NAMED} kinds)")
    perhaps = Counter({name: likely for name, (_, likely) in effects.items() if likely})
    if perhaps:
        name, most = perhaps.most_common(1)[0]
        often = "" if len(perhaps) == 1 else f" ({most} of them)"
        unsure = perhaps.total()
        said.append(f"{unsure} {_lack(unsure)} an effect not told from others, most likely {name}{often}")
    if lost := sum(table.get(UNEXPLAINED, (0, 0))):
        said.append(f"{lost} {'fails' if lost == 1 else 'fail'} in a way that the library does not explain")
    if failed := sum(table.get(FAILED, (0, 0))):
        said.append(f"{failed} could not be judged")
    return f"Of {total} machine{'' if total == 1 else 's'}, {'; '.join(said)}."


def _lack(count: int) -> str:
    return "lacks" if count == 1 else "lack"


def failures(briefs: Iterable[Brief]) -> list[dict[str, Any]]:
    """The reasons why files were not judged, grouped where only names and numbers differ, most frequent first.

    The reason is that of the group's first file, verbatim.
    """
    groups: dict[tuple[str, str], dict[str, Any]] = {}
    for brief in briefs:
        if brief.status != "ok":
            shape = re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", _without_name(brief.reason, brief.file))
            first = {"status": brief.status, "count": 0, "reason": brief.reason, "file": brief.file}
            groups.setdefault((brief.status, shape), first)["count"] += 1
    return sorted(groups.values(), key=lambda entry: (-entry["count"], entry["status"], entry["reason"]))


def _without_name(reason: str, file: str) -> str:
    """A reason without the file's name, with which many of them open."""
    return re.sub(r"\S*" + re.escape(os.path.basename(file)), "", reason)


def summary(ranking: Sequence[Brief]) -> dict[str, Any]:
    """The whole fleet in numbers."""
    told = judged(ranking)
    effects = Counter(brief.effects for brief in told if brief.verdict == "missing_effect")
    return {
        "sentence": sentence(ranking),
        "status": dict(Counter(brief.status for brief in ranking)),
        "verdicts": dict(Counter(brief.verdict for brief in told)),
        "effects": dict(effects.most_common()),
    }


def ratio(value: float) -> str:
    """An error over noise in three digits."""
    if math.isinf(value):
        return "ran away"
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}" if value < 1e6 else f"{value:.1e}"
