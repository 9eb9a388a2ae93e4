"""Pictures of the measured cases from the stored results: held-out data, where the model fails, what explains it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suite.benchmark import held_out
from suite.benchmark.table import markdown
from suite.case import Case, Held
from suite.discovery import misfit
from suite.discovery.discrepancy import discrepancy
from suite.discovery.fit import fit, homotopy, prepare
from suite.discovery.growing import grown
from suite.discovery.library import candidates
from suite.discovery.result import Discrepancy
from suite.discovery.state_map import bins
from suite.discovery.terms import Term
from suite.discovery.variable import samples as variable
from suite.effect import Effect
from suite.errors import DataError
from suite.model import Model, Parameter
from suite.record import Record
from suite.report.canvas import (
    BAND95,
    BLUE,
    INK,
    ORANGE,
    SKY,
    VERMILION,
    Array,
    dots,
    dressed,
    legend_below,
    new_figure,
    samples,
    thinned,
    time_label,
    timeline,
    wrapped,
)
from suite.report.failure import label_of
from suite.report.figures import plain

MOST = 600  # points of a curve: a picture stays below 150 kB
AGREES = 0.05  # of the stored error: how closely a model built again must reach it
Row = Mapping[str, Any]


def stored(path: Path) -> list[dict[str, Any]]:
    """The rows of `measured.json` that hold numbers."""
    rows: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return [row for row in rows if "reason" not in row]


def table(rows: Sequence[Row]) -> str:
    """A Markdown table of one case: its held-out parts, errors before and after, what was named, the verdict."""
    cells = [["held out", "error before", "error after", "named", "weight", "verdict"]]
    for row in rows:
        named = " and ".join(f"`{name.split(' in ')[0]}` in {name.split(' in ')[1]}" for name in row["named"])
        numbers = [f"{row['before']:.3g}", f"{row['after']:.3g}"]
        cells.append([row["part"], *numbers, named or "nothing", f"{row['weight']:.2f}", row["verdict"]])
    return markdown(cells)


def rebuilt(case: Case, train: Record, row: Row, effects: Mapping[str, Effect]) -> Model:
    """The model that discovery ended with, from the names and numbers of a stored row.

    The new parameters stand in the row in the order in which the effects brought them.
    """
    offered = candidates(case.deficient, effects, False, train)
    terms = [_term(offered, name, case.name) for name in row["named"]]
    free = [{name: Parameter(0.0, free=True) for name in (*term.names, *term.states)} for term in terms]
    model = grown(case.deficient, terms, free)
    names = dict(zip(model.parameters, row["parameters"].values(), strict=True))
    return model.with_values(names)


def _term(offered: Sequence[Term], name: str, case: str) -> Term:
    effect, equation = name.split(" in ")
    for term in offered:
        if term.effect.id == effect and term.equation == equation:
            return term
    raise DataError(f"{case}: {name} is in the stored result but no candidate; run `unmodelled bench measured` again")


def picture(case: Case, row: Row, folder: Path | None, effects: Mapping[str, Effect]) -> Figure:
    """One held-out part of one case; DataError where the models built again do not reach the stored errors."""
    train, parts = held_out.parts(case, folder)
    held, output = parts[row["part"]], row["output"]
    first = fit(case.deficient, train).model
    last = rebuilt(case, train, row, effects) if row["named"] else first
    ends = {"before": _simulated(first, held), "after": _simulated(last, held)}
    for which, Y in ends.items():
        rows = slice(held.first, None)
        error = misfit.rmse(held.record, Y, list(case.deficient.outputs), rows)[output]
        if abs(error - row[which]) > AGREES * row[which]:
            raise DataError(
                f"{case.name}, {row['part']}: the model {which} gives {error:.4g} now and {row[which]:.4g} in the "
                "stored result; run `unmodelled bench measured` again"
            )
    return _drawn(case, row, train, held, first, last, ends)


def _simulated(model: Model, held: Held) -> Array:
    share = 1.0 if held.lead is None else (held.lead + 0.5) / len(held.record)
    return misfit.simulate(model, held.record, share)


def _drawn(
    case: Case, row: Row, train: Record, held: Held, first: Model, last: Model, ends: Mapping[str, Array]
) -> Figure:
    fell = (
        f"{case.name}, {row['part']}: the error of {row['output']} falls from {row['before']:.3g} to {row['after']:.3g}"
    )
    stays = f"{case.name}, {row['part']}: the error of {row['output']} stays at {row['before']:.3g}"
    said = fell if row["named"] else stays
    fig = new_figure(said, f"{said}. {row['sentence']}", 7.6)
    grid = fig.add_gridspec(3, 2, height_ratios=[1.5, 0.8, 1.5])
    upper = fig.add_subplot(grid[0, :])
    lower = fig.add_subplot(grid[1, :], sharex=upper)
    j = list(first.outputs).index(row["output"])
    record = held.record
    t, _ = timeline(record)
    y = record.y[:, j]
    samples(upper, record, t, y, "#6A6A6A", "measured", MOST)
    curves = {"model as given, refitted": (VERMILION, ends["before"])}
    if row["named"]:
        curves["model amended"] = (BLUE, ends["after"])
    for label, (colour, Y) in curves.items():
        _line(upper, t, np.where(np.abs(Y[:, j]) < 1e6, Y[:, j], np.nan), colour, label)
        _line(lower, t, y - Y[:, j], colour, label)
    if held.first:
        for ax in (upper, lower):
            ax.axvspan(t[0], t[held.first], color="#EDEDED", linewidth=0, label="fitted, not judged")
    span = float(np.ptp(y))
    upper.set_ylim(float(y.min()) - 0.1 * span, float(y.max()) + 0.1 * span)
    dressed(upper, "", row["output"], f"Held out: {row['part']}")
    dressed(lower, time_label(record, first), "residual")
    upper.tick_params(labelbottom=False)
    found = discrepancy(*_calibrated(first, train))
    _where(fig.add_subplot(grid[2, 0]), first, last, train, found)
    _what(fig.add_subplot(grid[2, 1]), row)
    legend_below(fig, *fig.axes[:3])
    return fig


def _calibrated(model: Model, record: Record) -> tuple[Any, Any]:
    problem = prepare(misfit.frozen(model), record)
    point = homotopy(problem, problem.start).exact.point if problem.free_x0.any() else problem.start
    return problem, point


def _line(ax: Axes, t: Array, y: Array, colour: str, label: str) -> None:
    kept = thinned(y, MOST)
    ax.plot(t[kept], y[kept], color=colour, linewidth=1.3, label=label, zorder=3)


def _where(ax: Axes, first: Model, last: Model, record: Record, found: Discrepancy) -> None:
    """The smoothed model error of the training record against what orders it, and how the amended rate differs."""
    i = list(first.states).index(found.equation)
    v, d = variable(first, record, found), found.d[:, i]
    kept = thinned(d, MOST)
    dots(ax, v[kept], d[kept], "#C9CED3", "model error d, each sample", 2.6)
    b = bins(found, v, record, i)
    seen = b.count > 0
    shown = [*np.percentile(d, [0.5, 99.5]).tolist(), *b.mean[seen].tolist()]
    centre, spread = 0.5 * (b.edges[1:] + b.edges[:-1])[seen], BAND95 * b.sd[seen]
    ax.fill_between(centre, b.mean[seen] - spread, b.mean[seen] + spread, color=SKY, alpha=0.4, linewidth=0, zorder=3)
    ax.plot(centre, b.mean[seen], "o-", color=INK, markersize=4, linewidth=1.2, label="d, mean of a bin", zorder=4)
    if list(last.states) == list(first.states) and str(last) != str(first):
        inputs, times = record.u.tolist(), record.t.tolist()

        def gap(k: int) -> float:
            x, u = found.x[k], inputs[k]
            return float(last.rate(times[k], x, u)[i] - first.rate(times[k], x, u)[i])

        added = np.array([gap(k) for k in kept.tolist()])
        shown += [float(added.min()), float(added.max())]
        order = np.argsort(v[kept], kind="stable")
        if np.abs(np.diff(added[order])).sum() < 8 * (np.ptp(added) or 1.0):
            ax.plot(
                v[kept][order], added[order], color=ORANGE, linewidth=2.2, label="rate amended − rate given", zorder=5
            )
        else:
            dots(ax, v[kept], added, ORANGE, "rate amended − rate given", 2.4)
    # A single sample at which the smoother jumps is no reason to flatten all others.
    margin = 0.12 * (max(shown) - min(shown))
    ax.set_ylim(min(shown) - margin, max(shown) + margin)
    ax.axhline(0, color=INK, linewidth=0.8)
    label = label_of(first, record, found.variable)
    dressed(
        ax,
        label,
        f"missing in {found.equation}'",
        f"Where: d, of which {found.variable} orders {100 * found.ratio:.0f} %",
    )


def _what(ax: Axes, row: Row) -> None:
    """The weights of the plausible hypotheses as bars, and of none of them."""
    entries = sorted(row["plausible"], key=lambda entry: -entry["weight"])[:4]
    bars = [(" + ".join(plain(name) for name in entry["effects"]), entry["weight"]) for entry in entries]
    bars.append(("none of these", max(1.0 - sum(entry["weight"] for entry in row["plausible"]), 0.0)))
    for k, (_, weight) in enumerate(bars):
        ax.barh(k, weight, height=0.6, color="#9A9A9A" if k == len(bars) - 1 else BLUE if k == 0 else SKY)
        said = f"{100 * weight:.0f} %" if weight >= 0.005 else "< 1 %"
        ax.annotate(said, (weight, k), (4, 0), textcoords="offset points", va="center", fontsize=9)
    ax.set_yticks(range(len(bars)), [wrapped(label, 26) for label, _ in bars])
    ax.set_ylim(len(bars) - 0.4, -0.6)
    ax.set_xlim(0, 1.15)
    ax.set_xticks([0, 0.5, 1], ["0", "50 %", "100 %"])
    dressed(ax, "share of the weight", "", "What: the hypotheses")
    ax.tick_params(axis="y", labelsize=8.5)
    ax.grid(False, axis="y")
