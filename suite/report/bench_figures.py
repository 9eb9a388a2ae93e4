"""Figures of the benchmark, drawn from stored rows alone: nothing is run again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from suite.benchmark.statistics import score, summarise
from suite.files import writable_folder, written_whole

Array = npt.NDArray[np.float64]
Row = Mapping[str, Any]

# Okabe and Ito (2008): told apart by all eyes.
BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#666666"
COLORS = (BLUE, ORANGE, GREEN, RED, "#CC79A7", "#56B4E9", "#000000")
MARKERS = "osD^vP*X<>"
STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "svg.hashsalt": "unmodelled",
    "svg.fonttype": "none",
}


def draw(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Every figure of the matrix as SVG and PNG in `folder`; the paths written."""
    writable_folder(folder)
    # A measured case has no truth, hence no error to show.
    known = {row["case"] for row in rows if row.get("state_nrmse") is not None}
    judged = [row for row in rows if row["status"] != "skipped" and row["case"] in known]
    paths: list[Path] = []
    with mpl.rc_context(STYLE):
        for case in dict.fromkeys(row["case"] for row in judged):
            mine = [row for row in judged if row["case"] == case]
            paths += save(_boxes(mine, case), folder / f"{case}-errors")
            paths += save(_pace(mine, case), folder / f"{case}-accuracy-against-time")
        if judged:
            paths += save(_matrix(judged), folder / "comparison-matrix")
    return paths


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write a figure as SVG and PNG; the same rows give the same files."""
    paths = [stem.with_name(f"{stem.name}{ending}") for ending in (".svg", ".png")]
    with mpl.rc_context(STYLE), written_whole(paths[0]) as drawn, written_whole(paths[1]) as dots:
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        figure.savefig(dots, format="png", dpi=150)
    return paths


def canvas(width: float, height: float) -> Figure:
    """An empty figure that needs no display."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _best_first(rows: Sequence[Row], metric: str) -> list[tuple[str, str]]:
    """Estimator and variant, by the median of a metric over all rows; failures last."""
    groups: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        groups.setdefault((row["estimator"], row["variant"]), []).append(score(row, metric))
    return sorted(groups, key=lambda key: (float(np.median(groups[key])), key))


def _boxes(rows: Sequence[Row], case: str) -> Figure:
    """State error and model error of every estimator over seeds, a panel a noise level."""
    noises = sorted({row["noise"] for row in rows})
    order = _best_first(rows, "state_nrmse")[::-1]
    figure = canvas(2.8 + 2.6 * len(noises), 2.4 + 2 * 0.17 * len(order))
    axes = figure.subplots(2, len(noises), sharey=True, sharex="row", squeeze=False)
    figure.suptitle(
        f"{case}: error of states (top) and of the model error (bottom), over seeds\n"
        "orange: as shipped, blue: tuned; a cross: no seed ended well",
        fontsize=10,
    )
    for i, (metric, label) in enumerate((("state_nrmse", "state error / sd"), ("d_nrmse", "model error / its RMS"))):
        for j, noise in enumerate(noises):
            ax = axes[i, j]
            for k, (name, variant) in enumerate(order):
                found = [
                    row for row in rows if (row["noise"], row["estimator"], row["variant"]) == (noise, name, variant)
                ]
                _box(ax, k, [score(row, metric) for row in found], BLUE if variant == "tuned" else ORANGE)
            ax.set_xscale("log")
            decades(ax.xaxis)
            ax.grid(axis="x", color="0.9")
            ax.set_axisbelow(True)
            ax.set_xlabel(label)
            ax.set_yticks(
                range(len(order)), [f"{name}{', tuned' if v == 'tuned' else ''}" for name, v in order], fontsize=7
            )
            if i == 0:
                ax.set_title(f"noise {100 * noise:g} %")
    return figure


def decades(axis: Axis) -> None:
    """Ticks at 1, 2 and 5 of each decade, as plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _box(ax: Axes, at: int, values: Sequence[float], color: str) -> None:
    fine = np.array([value for value in values if np.isfinite(value) and value > 0])
    if len(fine):
        low, middle, high = np.quantile(fine, [0.25, 0.5, 0.75])
        ax.plot([fine.min(), fine.max()], [at, at], color=color, lw=1)
        ax.plot([low, high], [at, at], color=color, lw=5, solid_capstyle="butt", alpha=0.6)
        ax.plot(middle, at, "o", color=color, ms=3.5)
    elif len(values):
        ax.plot(0.02, at, "x", color=RED, ms=5, transform=ax.get_yaxis_transform())


def _matrix(rows: Sequence[Row]) -> Figure:
    """Ratio of the state error to the untuned EKF's: a line an estimator, a column a case and noise."""
    summary = {(s["case"], s["noise"], s["estimator"], s["variant"]): s for s in summarise(rows, ("state_nrmse",))}
    columns = list(dict.fromkeys((key[0], key[1]) for key in sorted(summary)))
    names = _best_first(rows, "state_nrmse")
    grid = np.array(
        [[summary.get((*column, *name), {}).get("ratio", np.nan) for column in columns] for name in names], dtype=float
    )
    figure = canvas(max(6.5, 3.4 + 0.62 * len(columns)), 2.2 + 0.24 * len(names))
    ax = figure.subplots()
    # Purple to orange through white: told apart by all eyes; equal steps of the ratio up and down.
    image = ax.imshow(np.log2(grid), cmap="PuOr_r", vmin=-3, vmax=3, aspect="auto")
    for i, j in np.ndindex(*grid.shape):
        value = grid[i, j]
        dark = np.isfinite(value) and abs(np.log2(value)) > 1.3
        text = f"{value:.2f}" if value < 100 else ">100"
        if not np.isfinite(value):
            line = summary.get((*columns[j], *names[i]))
            text = "" if line is None else "failed" if line["ok"] == 0 else "no EKF"
        ax.text(j, i, text, ha="center", va="center", fontsize=6.5, color="white" if dark else "black")
    cases = [f"{case}, {100 * noise:g} %" for case, noise in columns]
    ax.set_xticks(range(len(columns)), cases, rotation=40, ha="right", fontsize=7)
    ax.set_yticks(range(len(names)), [f"{name}{', tuned' if v == 'tuned' else ''}" for name, v in names], fontsize=7)
    ax.set_title("State error over the untuned EKF's, median over seeds (below 1 is better)")
    bar = figure.colorbar(image, ax=ax, ticks=[-3, -2, -1, 0, 1, 2, 3], pad=0.01)
    bar.ax.set_yticklabels(["1/8", "1/4", "1/2", "1", "2", "4", "8"], fontsize=7)
    return figure


def _pace(rows: Sequence[Row], case: str) -> Figure:
    """Accuracy against run time: medians at one noise level, with the Pareto front."""
    noises = sorted({row["noise"] for row in rows})
    noise = 0.05 if 0.05 in noises else noises[-1]
    lines = [s for s in summarise(rows, ("state_nrmse", "step_us")) if s["noise"] == noise]
    points = [s for s in lines if np.isfinite(s.get("state_nrmse", np.inf)) and np.isfinite(s.get("step_us", np.inf))]
    figure = canvas(8.5, 4.6)
    ax = figure.subplots()
    best = np.inf
    front = []
    for s in sorted(points, key=lambda s: s["step_us"]):
        if s["state_nrmse"] < best:
            best = s["state_nrmse"]
            front.append(s)
    ax.step([s["step_us"] for s in front], [s["state_nrmse"] for s in front], where="post", color=GREY, lw=1, zorder=1)
    for k, name in enumerate(sorted({s["estimator"] for s in points})):
        look: dict[str, Any] = {
            "color": COLORS[k % len(COLORS)],
            "marker": MARKERS[k % len(MARKERS)],
            "ms": 6,
            "ls": "",
            "zorder": 2,
        }
        for s in (s for s in points if s["estimator"] == name):
            face = look["color"] if s["variant"] == "tuned" else "none"
            ax.plot(s["step_us"], s["state_nrmse"], markerfacecolor=face, **look)
        ax.plot([], [], label=name, **look)
    figure.legend(loc="outside right upper", fontsize=7.5, frameon=False)
    ax.set_xscale("log")
    ax.set_yscale("log")
    decades(ax.yaxis)
    ax.set_xlabel("run time a step [microseconds]")
    ax.set_ylabel("state error / sd, median")
    ax.set_title(
        f"{case}, noise {100 * noise:g} %: accuracy against run time\n"
        "(hollow: as shipped, filled: tuned; line: nothing is both faster and better)"
    )
    return figure
