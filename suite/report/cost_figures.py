"""Run time a step against the size of the model and the length of the record, a line a method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suite import plugins
from suite.benchmark import table
from suite.files import writable_folder
from suite.report.bench_figures import COLORS, MARKERS, STYLE, decades, save
from suite.report.canvas import dressed, new_figure

Row = Mapping[str, Any]
NAMED = 7  # lines with a colour and a name in a panel


def write(rows: Sequence[Row], folder: Path) -> list[Path]:
    """cost.csv and the two figures in `folder`; the paths written."""
    writable_folder(folder)
    table.write(rows, folder / "cost.csv")
    with mpl.rc_context(STYLE):
        figures = {
            "cost-against-states": _figure(
                rows, "states", "What does a step cost as the model grows?",
                "states n of a chain of masses", "200 samples, at most five outputs",
            ),
            "cost-against-length": _figure(
                rows, "samples", "What does a step cost as the record grows?",
                "samples of the record", "two states, one output; a level line is a cost in proportion to the length",
            ),
        }  # fmt: skip
        paths = [path for name, figure in figures.items() for path in save(figure, folder / name)]
    return [folder / "cost.csv", *paths]


def _figure(rows: Sequence[Row], axis: str, title: str, label: str, setting: str) -> Figure:
    """A panel for what this project computes itself, one for what filterpy and CasADi do."""
    mine = [row for row in rows if row["axis"] == axis and row["status"] == "ok"]
    fig = new_figure(
        title,
        f"Run time a step against the {label}: {setting}. A line ends where the next size would have taken too long, "
        "where the method refuses the model, or where it failed; the table says which.",
        5.2,
    )
    panels = fig.subplots(1, 2, sharex=True, sharey=True)
    for ax, (family, words) in zip(panels, {"estimators": "estimators", "baselines": "baselines"}.items(), strict=True):
        names = plugins.find(family).loaded
        dressed(ax, label, "run time a step [microseconds]", words)
        ax.set_xscale("log")
        ax.set_yscale("log")
        decades(ax.yaxis)
        _lines(ax, [row for row in mine if row["estimator"] in names], axis)
    panels[1].set_ylabel("")
    sizes = sorted({row[axis] for row in mine})
    for ax in panels:
        ax.set_xticks(sizes, [f"{size:,}" if size < 10_000 else f"{size:.0e}".replace("e+0", "e") for size in sizes])
        ax.minorticks_off()
    return fig


def _lines(ax: Axes, rows: Sequence[Row], axis: str) -> None:
    """The quickest, the slowest and some between by name; the rest in grey."""
    lines: dict[str, list[tuple[int, float]]] = {}
    for row in rows:
        lines.setdefault(row["estimator"], []).append((row[axis], row["step_us"]))
    order = sorted(lines, key=lambda name: lines[name][0][1])
    step = max((len(order) - 1) / max(NAMED - 1, 1), 1.0)
    named = [order[round(k * step)] for k in range(NAMED) if round(k * step) < len(order)]
    for name in order:
        if name not in named:
            ax.plot(*zip(*lines[name], strict=True), color="0.8", linewidth=0.9, zorder=1)
    for k, name in enumerate(named):
        ax.plot(
            *zip(*lines[name], strict=True), color=COLORS[k % len(COLORS)], marker=MARKERS[k], linewidth=1.6,
            markersize=5, label=name,
        )  # fmt: skip
    if len(order) > len(named):
        ax.plot([], [], color="0.8", label=f"{len(order) - len(named)} others")
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), fontsize=8.5, frameon=False, ncols=2)
