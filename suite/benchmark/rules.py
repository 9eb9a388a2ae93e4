"""Rules of a plan that keep it within its time: which methods run on fewer seeds, small models or fewer variants."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from suite.errors import InputError


@dataclass(frozen=True)
class Rule:
    """A limit on methods by pattern: judged seeds at most, states of the model at most, variants; None: no limit.

    `tuned_as` names the estimator whose tuned values serve these too, in place of a tuning of their own (the process
    noise of an EKF serves every filter with that noise). `because` is the reason, which stands in the plan file beside
    the limit.
    """

    estimators: tuple[str, ...]
    because: str
    seeds: int | None = None
    most_states: int | None = None
    variants: tuple[str, ...] | None = None
    tuned_as: str | None = None

    def holds(self, estimator: str) -> bool:
        """Whether it is about a method."""
        return any(fnmatch.fnmatchcase(estimator, pattern) for pattern in self.estimators)


def allowed(rules: Sequence[Rule], estimator: str, variant: str, states: int, seeds: int) -> int:
    """How many seeds of a cell the rules leave, 0 for none of it."""
    for rule in (rule for rule in rules if rule.holds(estimator)):
        if rule.most_states is not None and states > rule.most_states:
            return 0
        # A point of a grid was asked for by name.
        if rule.variants is not None and variant not in rule.variants and "=" not in variant:
            return 0
        seeds = min(seeds, rule.seeds or seeds)
    return seeds


def tuners(rules: Sequence[Rule], tuning: Mapping[str, Collection[str]]) -> dict[str, str]:
    """Whose tuned values serve a method, by method, where they are not its own; `tuning`: each method's numbers."""
    found: dict[str, str] = {}
    for rule in (rule for rule in rules if rule.tuned_as is not None):
        served = [name for name in tuning if rule.holds(name) and name != rule.tuned_as]
        unlike = [name for name in served if set(tuning[name]) != set(tuning.get(str(rule.tuned_as), ()))]
        if unlike:
            raise InputError(f"tuned_as = {rule.tuned_as!r}: it does not tune the same numbers as {', '.join(unlike)}")
        found |= dict.fromkeys(served, str(rule.tuned_as))
    return found


def parse(tables: Sequence[Any], variants: Sequence[str], source: str) -> tuple[Rule, ...]:
    """The rules of a plan's [[rules]] tables; InputError says which entry is wrong."""
    return tuple(_rule(table, variants, f"{source}: rule {place}") for place, table in enumerate(tables, 1))


def _rule(table: Any, variants: Sequence[str], where: str) -> Rule:
    known = ("estimators", "because", "seeds", "most_states", "variants", "tuned_as")
    if not isinstance(table, dict) or not set(table) <= set(known):
        raise InputError(f"{where}: {table!r}; expected a table of {', '.join(known)}")
    for key in ("estimators", "variants"):
        entries = table.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, str) for entry in entries):
            raise InputError(f"{where}: {key} = {entries!r}; expected a list of names")
    if not table.get("estimators") or not isinstance(table.get("because"), str):
        raise InputError(f"{where}: it needs estimators, a list of names, and because, a reason in words")
    if not set(table.get("variants", [])) <= set(variants):
        raise InputError(f"{where}: variants = {table['variants']!r}; expected some of {', '.join(variants)}")
    for key in ("seeds", "most_states"):
        count = table.get(key, 1)
        if not isinstance(count, int) or isinstance(count, bool) or count < 1:
            raise InputError(f"{where}: {key} = {count!r}; expected a whole number above zero")
    if not isinstance(table.get("tuned_as", ""), str):
        raise InputError(f"{where}: tuned_as = {table['tuned_as']!r}; expected the name of an estimator")
    fields: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    return Rule(**fields)
