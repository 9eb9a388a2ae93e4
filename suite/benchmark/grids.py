"""Grids of keyword arguments: `ekf[q_scale=0.1,1,10]` names an estimator at three values, each a variant of its own.

A variant is written `q_scale=0.1`, several keywords `alpha=1,q_scale=0.1`; it is read back from its own label, so
that the store needs nothing beside it.
"""

from __future__ import annotations

import fnmatch
import inspect
import math
import re
import typing
from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any

from suite.errors import InputError
from suite.estimator import Estimator

GRID = re.compile(r"(?P<pattern>.+)\[(?P<points>[^\[\]]*=[^\[\]]*)\]")
Value = float | str
MOST = 10_000  # points of one grid


def split(entry: str) -> tuple[str, dict[str, list[Value]]]:
    """The pattern of an entry and its grid by keyword; {} where it has none."""
    found = GRID.fullmatch(entry.strip())
    if found is None:
        if "=" in entry:
            raise InputError(f"{entry!r} is not a grid; write name[keyword=value,value], with quotes in a shell")
        return entry, {}
    grid: dict[str, list[Value]] = {}
    keyword = ""
    for part in found["points"].split(","):
        name, sign, value = part.rpartition("=")
        keyword = name.strip() if sign else keyword
        if not keyword.isidentifier() or not value.strip():
            raise InputError(f"{entry!r}: {part!r} is not a value of a keyword; write name[keyword=value,value]")
        if sign and keyword in grid:
            raise InputError(f"{entry!r}: {keyword!r} is given twice; write all its values after one =")
        grid.setdefault(keyword, []).append(_value(value.strip()))
    return found["pattern"], grid


def variants(grid: Mapping[str, list[Value]]) -> list[str]:
    """The label of each point: the product of the values of all keywords, in the order given."""
    if math.prod(map(len, grid.values())) > MOST:
        raise InputError(f"a grid over {', '.join(grid)} of more than {MOST} points; give fewer values")
    points = product(*([(name, value) for value in values] for name, values in grid.items()))
    return [",".join(f"{name}={_text(value)}" for name, value in point) for point in points]


def values(variant: str) -> dict[str, Value]:
    """The keyword arguments that a variant states; {} for one that is no point of a grid."""
    if "=" not in variant:
        return {}
    return {name: _value(text) for name, _, text in (part.partition("=") for part in variant.split(","))}


def chosen(entries: Iterable[str], known: Mapping[str, Any]) -> dict[str, dict[str, None]]:
    """Per estimator named by the entries, in order, the labels of its grid points ("" for a plain entry).

    A pattern with a grid means the estimators that take its keywords; a full name must take them.
    """
    picked: dict[str, dict[str, None]] = {}
    for entry in entries:
        pattern, grid = split(entry)
        named = [name for name in known if fnmatch.fnmatchcase(name, pattern)]
        if not named:
            raise InputError(f"no estimator is named like {pattern!r}; there are {', '.join(known)}")
        refused = {name: reason for name in named if (reason := _refusal(known[name], grid)) is not None}
        if len(refused) == len(named):
            raise InputError(f"{entry!r}: {next(iter(refused.values()))}")
        for name in named:
            if name not in refused:
                picked.setdefault(name, {}).update(dict.fromkeys(variants(grid) if grid else [""]))
    return picked


def keywords(estimator: Estimator) -> dict[str, Any] | None:
    """The keyword arguments of `estimate` with their types (None: not stated); None where it takes any."""
    hints = _hints(estimator.estimate)
    found: dict[str, Any] = {}
    for parameter in list(inspect.signature(estimator.estimate).parameters.values())[2:]:
        if parameter.kind is inspect.Parameter.VAR_KEYWORD:
            table = next(iter(typing.get_args(hints.get(parameter.name))), None)
            if table is None:
                return None
            found |= _hints(table)
        elif parameter.kind is not inspect.Parameter.VAR_POSITIONAL:
            found[parameter.name] = hints.get(parameter.name)
    return found


def _refusal(estimator: Any, grid: Mapping[str, list[Value]]) -> str | None:
    """Why an estimator does not take a grid, in a sentence, or None."""
    # A reference row has no keywords.
    known = keywords(estimator) if isinstance(estimator, Estimator) else {}
    if known is None:
        return None
    for name, points in grid.items():
        if name not in known:
            return f"{estimator.name} has no keyword argument {name!r}; it has {', '.join(known) or 'none'}"
        words = typing.get_args(known[name]) if typing.get_origin(known[name]) is typing.Literal else None
        for point in points:
            if words is not None and point not in words:
                return f"{name} of {estimator.name} is one of {', '.join(map(str, words))}, not {_text(point)}"
            if known[name] in (float, int) and isinstance(point, str):
                return f"{name} of {estimator.name} is a number, not {point!r}"
    return None


def _hints(thing: Any) -> dict[str, Any]:
    try:
        return typing.get_type_hints(thing)
    except (NameError, TypeError):  # a foreign plug-in's hint that cannot be resolved: nothing is known of the types
        return {}


def _value(text: str) -> Value:
    """A number where it is one, else a word."""
    try:
        number = float(text)
    except ValueError:
        return text
    return int(number) if re.fullmatch(r"[+-]?\d+", text) else number


def _text(value: Value) -> str:
    """The shortest text that is read back as the same value."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() and abs(value) < 1e6 else str(value)
