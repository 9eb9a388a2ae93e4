"""Where the numbers come from: failures in the words of who failed, versions, hashes, the command that repeats it."""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from suite.benchmark import plan
from suite.benchmark.comparison import Comparison, Method
from suite.errors import InputError

Row = Mapping[str, Any]
MOST = 60  # kinds of failure on the page; all of them are in failures.csv


def failures(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Every cell that did not end well, grouped where method, status and reason agree but for numbers.

    The reason is that of the group's first cell, verbatim; the most frequent first.
    """
    groups: dict[tuple[str, ...], dict[str, Any]] = {}
    for row in rows:
        if row["status"] == "ok":
            continue
        shape = re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", str(row["reason"]))
        key = (row["estimator"], row["variant"], row["status"], shape)
        entry = groups.setdefault(
            key,
            {
                "method": Method(row["estimator"], row["variant"]).label, "status": row["status"], "cells": 0,
                "cases": {}, "first": f"{row['case']} noise={row['noise']:g} seed={row['seed']}",
                "reason": str(row["reason"]),
            },
        )  # fmt: skip
        entry["cells"] += 1
        entry["cases"][row["case"]] = None
    found = [{**entry, "cases": ", ".join(entry["cases"])} for entry in groups.values()]
    return sorted(found, key=lambda entry: (entry["status"] == "skipped", -entry["cells"], entry["method"]))


def metric_errors(rows: Iterable[Row]) -> dict[str, str]:
    """What plug-in metrics raised, the first of each."""
    found: dict[str, str] = {}
    for row in rows:
        for name, reason in (row.get("metric_errors") or {}).items():
            found.setdefault(name, str(reason))
    return found


def versions(rows: Iterable[Row]) -> dict[str, str]:
    """Versions under which the rows were made, several where they differ."""
    found: dict[str, dict[str, None]] = {}
    for row in rows:
        for name, version in (row.get("versions") or {}).items():
            found.setdefault(name, {})[version] = None
    return {name: ", ".join(values) for name, values in sorted(found.items())}


def hashes(rows: Iterable[Row]) -> list[tuple[str, str, str]]:
    """Kind, name and hash of each plug-in whose rows are here."""
    found: dict[tuple[str, str, str], None] = {}
    for row in rows:
        for kind, name, key in (("case", "case", "case_hash"), ("method", "estimator", "plugin_hash")):
            if row.get(key):
                found[kind, row[name], row[key]] = None
    return sorted(found)


def dates(rows: Sequence[Row]) -> tuple[str, str]:
    """When the first and the last row were made, UTC."""
    whens = [row["when"] for row in rows if row.get("when")] or [0.0]
    first, last = (time.strftime("%Y-%m-%d %H:%M", time.gmtime(f(whens))) for f in (min, max))
    return first, last


def commands(c: Comparison, store: str) -> list[str]:
    """What makes these rows again: the smallest shipped plan that has them all, else a plan in a file."""
    seeds = c.seeds[1]
    wanted = {(at[0], at[1], m.estimator, m.variant) for m, table in c.rows.items() for at in table}
    fitting = []
    for name in plan.shipped():
        try:
            cells = plan.load(name).cells()
        except InputError:
            continue
        have = {(cell.case, cell.noise, cell.estimator, cell.variant) for cell in cells}
        if wanted <= have:
            fitting.append((len(have), name))
    name = min(fitting)[1] if fitting else "PLAN.toml"
    run = f"unmodelled bench run --plan {name} --seeds {seeds} --store {store}"
    return [run, f"unmodelled bench report --store {store} -o DIR"]


def plan_text(c: Comparison) -> str:
    """The plan of these rows as TOML, for where no shipped plan has them."""
    cases = sorted({at[0] for table in c.rows.values() for at in table})
    noises = sorted({noise for _, noise in c.conditions})
    names = sorted({m.estimator for m in (*c.rows, *c.references)})
    quoted = [", ".join(f'"{name}"' for name in part) for part in (cases, names)]
    levels = ", ".join(f"{noise:g}" for noise in noises)
    return f"cases = [{quoted[0]}]\nestimators = [{quoted[1]}]\nnoises = [{levels}]\nseeds = {c.seeds[1]}\n"
