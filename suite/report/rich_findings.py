"""Verdicts, ledgers and benchmark results as HTML for a notebook: the sentence first, bars for weights and errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from suite.benchmark.table import COLUMNS
from suite.discovery.result import Candidate, Ledger, Named, Verdict
from suite.discovery.words import value_sd
from suite.report.rich import escaped, table

BAR = 120  # pixels of a bar of full length
BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"


def verdict_html(verdict: Verdict) -> str:
    """A verdict: its sentence, the plausible hypotheses with their weights as bars, errors, parameters, advice."""
    parts = [f"<p><strong>{escaped(verdict.verdict)}</strong>: {escaped(verdict.sentence)}</p>"]
    if verdict.plausible:
        rows = [_candidate(candidate, rank) for rank, candidate in enumerate(verdict.plausible)]
        parts.append(table(["hypothesis", "term", "coefficients", "weight", "", "delta²"], rows, (3, 5)))
    parts.append(table(["error of", "as given, refitted", "with it", "noise"], _errors(verdict), (1, 2, 3)))
    if verdict.parameters:
        numbers = [
            [escaped(name), _number(entry["before"]), _with_sd(entry["value"], entry["sd"])]
            for name, entry in verdict.parameters.items()
        ]
        parts.append(table(["parameter", "in the file", "fitted"], numbers, (1, 2)))
    advice = "".join(f"<li>{escaped(sentence)}</li>" for sentence in verdict.advice)
    return "".join(parts) + (f"<ul>{advice}</ul>" if advice else "")


def _candidate(candidate: Candidate, rank: int) -> list[str]:
    effects = candidate.effects
    apart = "the best" if rank == 0 else "" if candidate.separation is None else _number(candidate.separation)
    return [
        "<br>".join(escaped(f"{named.effect} in {named.equation}") for named in effects),
        "<br>".join(f"<code>{escaped(named.term)}</code>" for named in effects),
        "<br>".join(_coefficients(named) for named in effects),
        f"{candidate.weight:.2f}" if candidate.weight >= 0.005 else "&lt; 0.01",
        bar(candidate.weight, BLUE),
        apart,
    ]


def _coefficients(named: Named) -> str:
    return ", ".join(
        escaped(f"{name} = ") + _with_sd(c.value, c.sd) + escaped(f" {c.unit}" if c.unit else "")
        for name, c in named.coefficients.items()
    )


def _errors(verdict: Verdict) -> list[list[str]]:
    error = verdict.error
    rows = [
        [escaped(name), _number(before), _number(error["after"][name]), _number(error["noise"][name])]
        for name, before in error["before"].items()
    ]
    held = error.get("held_out", {})
    return rows + [
        [escaped(f"{name}, held out"), _number(before), _number(held["after"][name]), ""]
        for name, before in held.get("before", {}).items()
    ]


def ledger_html(ledger: Ledger) -> str:
    """A ledger: its sentence, and for each step what the model had gained and its errors, as bars to the first's."""
    outputs = list(ledger.steps[0].model.outputs)
    noise = dict(zip(outputs, ledger.steps[-1].comparison.sigma.tolist(), strict=True))
    held = [name for name in outputs if any(name in step.held_out for step in ledger.steps)]
    headings = ["step", "the model"]
    for name in outputs:
        headings += [f"error of {name} (noise {noise[name]:.2g})", ""] + (["held out", ""] if name in held else [])
    full = {name: _largest([step.comparison.error[name] for step in ledger.steps]) for name in outputs}
    rest = {name: _largest([step.held_out.get(name, math.nan) for step in ledger.steps]) for name in held}
    rows = []
    for number, step in enumerate(ledger.steps):
        added = ledger.history[number]["added"] if number < len(ledger.history) else {}
        gained = ", ".join(f"{name} = {value:.4g}" for name, value in added.items())
        row = [str(number), escaped(gained or "as given, refitted")]
        for name in outputs:
            error = step.comparison.error[name]
            row += [_number(error), bar(error / full[name], GREEN if error < 1.15 * noise[name] else BLUE)]
            if name in held:
                error = step.held_out.get(name, math.nan)
                row += [_number(error), bar(error / rest[name], ORANGE)]
        rows.append(row)
    numbers = list(range(2, len(headings), 2))
    return f"<p>{escaped(ledger.sentence)}</p>" + table(headings, rows, numbers)


@dataclass(frozen=True)
class Results:
    """Lines of the benchmark (`suite.benchmark.table.lines`) that a notebook shows as a table."""

    lines: Sequence[Mapping[str, Any]]

    def _repr_html_(self) -> str:
        shown = [column for column in COLUMNS if any(line.get(column.field) is not None for line in self.lines)]
        rows = [[escaped(column.form(line.get(column.field))) for column in shown] for line in self.lines]
        numbers = [j for j, column in enumerate(shown) if any(_numeric(line.get(column.field)) for line in self.lines)]
        meaning = "; ".join(f"{column.heading}: {column.meaning}" for column in shown)
        return table([column.heading for column in shown], rows, numbers) + f"<p><small>{escaped(meaning)}</small></p>"


def bar(share: float, colour: str) -> str:
    """A bar of a share of the full length; nothing where there is no number."""
    if not math.isfinite(share):
        return ""
    wide = BAR * min(max(share, 0.0), 1.0)
    drawn = f'<rect width="{wide:.1f}" height="10" fill="{colour}"/>'
    return f'<svg width="{BAR}" height="10" viewBox="0 0 {BAR} 10" aria-hidden="true">{drawn}</svg>'


def _largest(values: Sequence[float]) -> float:
    return max((value for value in values if math.isfinite(value)), default=1.0) or 1.0


def _numeric(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number(value: float) -> str:
    return "diverged" if math.isinf(value) else "" if math.isnan(value) else f"{value:.3g}"


def _with_sd(value: float, sd: float) -> str:
    return escaped(value_sd(value, sd).replace("+-", "±"))
