"""Measured cases judged on what was not fitted: free-run errors before and after discovery."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from suite import plugins
from suite.benchmark import table
from suite.case import Case, Held
from suite.discovery import misfit
from suite.discovery.hold_out import split
from suite.discovery.loop import discover
from suite.discovery.result import Ledger
from suite.effect import Effect
from suite.errors import DataError, InputError
from suite.files import writable_folder, write_whole
from suite.model import Model
from suite.record import Record


@dataclass(frozen=True)
class Target:
    """What is to be reached on a held-out part: the error at most, and the effects of which one is to be named."""

    error: float
    effects: tuple[str, ...]


DRAG = ("quadratic_drag", "viscous_damping", "power_term")
TARGETS: Mapping[tuple[str, str], Target] = {
    ("silverbox", "arrow"): Target(1.0e-3, ("cubic_stiffness",)),
    ("silverbox", "multisine"): Target(0.95e-3, ("cubic_stiffness",)),
    ("emps", "pulses"): Target(0.135, ("coulomb_friction",)),
    ("cascaded-tanks", "validation"): Target(0.40, ("overflow", "outflow")),
    ("rocket-camoes", "last 40 %"): Target(12.0, DRAG),
    ("yellow-whiffle-ball", "drop 2"): Target(0.3, DRAG),
    ("whiffle-ball", "last run"): Target(0.3, DRAG),
    ("indometacin", "subject 6"): Target(0.05, ("second_compartment",)),
    ("cefamandole", "subject 6"): Target(6.0, ("second_compartment",)),
}
HEADINGS = ("case", "held out", "before", "after", "target", "reached", "named", "weight", "verdict", "seconds")


def parts(case: Case, folder: Path | None) -> tuple[Record, Mapping[str, Held]]:
    """The record that is fitted and the parts that are judged, by name.

    Where a case names none, the last of several runs or the last 30 % of a single one is held out. DataError where
    the data are not there, or too short to hold anything out.
    """
    if case.measured is None:
        raise InputError(f"{case.name} is simulated; choose a measured case")
    record = case.measured(folder)
    if case.held_out is not None:
        return record, case.held_out(folder)
    cut = split(record)
    if cut is None:
        raise DataError(f"{case.name}: {len(record)} samples are too few to hold some out; name them in held_out")
    name = "last run" if cut.first == 0 else "last 30 %"
    return cut.train, {name: Held(cut.judged, lead=cut.first or None, first=cut.first)}


def error(model: Model, held: Held) -> dict[str, float]:
    """Free-run RMSE of a model at its values on a held-out part, by output; infinite if it diverges."""
    count = len(held.record)
    share = 1.0 if held.lead is None else (held.lead + 0.5) / count
    Y = misfit.simulate(model, held.record, share)
    names = list(model.outputs)
    found = misfit.rmse(held.record, Y, names, slice(held.first, None))
    # A simulation that stops short leaves zeros behind, which would pass for an answer.
    whole = np.isfinite(Y).all() and Y[-1].any()
    return {name: value if whole else np.inf for name, value in found.items()}


def judge(case: Case, folder: Path | None, effects: Mapping[str, Effect]) -> list[dict[str, Any]]:
    """One row for each held-out part and output: errors before and after discovery on the training record alone."""
    train, held = parts(case, folder)
    began = time.perf_counter()
    ledger = discover(case.deficient, train, effects)
    seconds = time.perf_counter() - began
    first, last = ledger.steps[0].model, ledger.steps[-1].model
    common = {"case": case.name, "samples": len(train), **_said(ledger), "seconds": seconds}
    rows = []
    for name, part in held.items():
        before, after = error(first, part), error(last, part)
        target = TARGETS.get((case.name, name))
        for output in before:
            row = {**common, "part": name, "output": output, "before": before[output], "after": after[output]}
            rows.append({**row, **_against(target, after[output], common["named"])})
    return rows


def _said(ledger: Ledger) -> dict[str, Any]:
    """What the loop named and with which weight; the plausible set of its first verdict."""
    verdicts = [step.verdict for step in ledger.steps if step.verdict]
    added = [effect for verdict in verdicts[: len(ledger.steps) - 1] for effect in verdict.effects]
    plausible = [
        {"effects": [f"{e.effect} in {e.equation}" for e in candidate.effects], "weight": candidate.weight}
        for candidate in verdicts[0].plausible
    ]
    return {
        "verdict": verdicts[0].verdict,
        "end": verdicts[-1].verdict,
        "named": [f"{effect.effect} in {effect.equation}" for effect in added],
        "weight": verdicts[0].weight,
        "plausible": plausible,
        "sentence": ledger.sentence,
        "parameters": {name: p.value for name, p in ledger.steps[-1].model.parameters.items()},
    }


def _against(target: Target | None, after: float, named: list[str]) -> dict[str, Any]:
    if target is None:
        return {"target": None, "reached": None}
    right = any(entry.split(" in ")[0] in target.effects for entry in named)
    reached = (
        "yes" if after <= target.error and right else "error" if right else "effect" if after <= target.error else "no"
    )
    return {"target": target.error, "reached": reached, "wanted": list(target.effects)}


def chosen(pattern: str | None) -> list[Case]:
    """The measured cases whose name has the pattern in it (or matches its * and ?)."""
    measured = [case for case in plugins.cases().values() if case.measured is not None]
    found = [case for case in measured if pattern is None or pattern in case.name or fnmatch(case.name, pattern)]
    if not found:
        raise InputError(f"--only {pattern}: no such measured case; there are {', '.join(c.name for c in measured)}")
    return found


def verb(args: argparse.Namespace) -> int:
    """`bench measured`: judge, write, and show the table (or JSON alone); 0 done, 2 by InputError."""
    rows = run(args.only, args.data, args.output)
    print(table.to_json(rows) if args.json else text(rows))
    return 0


def run(pattern: str | None, folder: Path | None, output: Path | None) -> list[dict[str, Any]]:
    """Judge the chosen cases; `output` has measured.txt, .csv and .json, rewritten after each case.

    A case whose data are not there, or whose discovery fails, is a row with the reason.
    """
    effects, rows = plugins.effects(), []
    for case in chosen(pattern):
        print(f"{case.name} ...", file=sys.stderr, flush=True)
        try:
            rows += judge(case, folder, effects)
        except (InputError, ArithmeticError, ValueError, np.linalg.LinAlgError) as failure:
            rows.append({"case": case.name, "part": "", "reason": f"{failure}"})
        if output is not None:
            _write(rows, output)
    return rows


def _write(rows: list[dict[str, Any]], output: Path) -> None:
    writable_folder(output)
    write_whole(output / "measured.txt", text(rows) + "\n")
    table.write(rows, output / "measured.json")
    table.write(
        [{k: v for k, v in row.items() if k not in ("plausible", "parameters")} for row in rows],
        output / "measured.csv",
    )


def text(rows: Iterable[Mapping[str, Any]]) -> str:
    """The rows as an aligned table, reasons of cases without numbers below it."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.3g}"

    cells: list[list[Any]] = [list(HEADINGS)]
    reasons: list[str] = []
    for row in rows:
        if "reason" in row:
            reasons.append(f"{row['case']}: {row['reason']}")
            continue
        numbers = [number(row[key]) for key in ("before", "after", "target")]
        named = ", ".join(row["named"]) or "nothing"
        last = [row["reached"] or "", named, f"{row['weight']:.2f}", row["verdict"], f"{row['seconds']:.0f}"]
        cells.append([row["case"], row["part"], *numbers, *last])
    return "\n".join([table.grid(cells), *reasons])
