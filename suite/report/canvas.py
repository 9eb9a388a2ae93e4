"""What every figure shares: colours, thinning that keeps spikes, and a time axis for several runs."""

from __future__ import annotations

import textwrap

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

# Okabe and Ito (2008): told apart with every kind of colour vision, and in grey.
INK, BLUE, SKY, ORANGE, VERMILION, GREEN, GREY = (
    "#222222",
    "#0072B2",
    "#56B4E9",
    "#E69F00",
    "#D55E00",
    "#009E73",
    "#8A8A8A",
)
WIDTH = 9.0
MOST = 4000
BAND95, BAND99 = 1.96, 2.576


def new_figure(title: str, description: str, height: float) -> Figure:
    """An empty figure of the report's width; the title is the sentence of what is seen, the description for ears."""
    fig = Figure(figsize=(WIDTH, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(fig)
    fig.suptitle(wrapped(title, 84), x=0.01, ha="left", fontsize=13, fontweight="bold", color=INK)
    fig.set_label(description)
    return fig


def wrapped(text: str, width: int) -> str:
    """Text in lines of at most `width` characters, control characters shown as '?'."""
    shown = "".join(letter if letter.isprintable() else "?" for letter in " ".join(text.split()))
    return textwrap.fill(shown, width)


def dressed(ax: Axes, xlabel: str, ylabel: str, title: str = "") -> Axes:
    """The axes with labels, a quiet frame and a light grid."""
    ax.set_xlabel(wrapped(xlabel, 90), fontsize=10)
    ax.set_ylabel(wrapped(ylabel, 30), fontsize=10)
    if title:
        ax.set_title(wrapped(title, 96), loc="left", fontsize=11, color=INK)
    ax.tick_params(labelsize=9.5, colors=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color="#E4E4E4", linewidth=0.7)
    ax.set_axisbelow(True)
    return ax


def legend_below(fig: Figure, *axes: Axes) -> None:
    """One legend under the panels, where it can hide no data; each name once."""
    entries: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if entries:
        labels = list(entries)
        columns = 5 if sum(map(len, labels)) <= 70 else 3
        fig.legend(list(entries.values()), labels, loc="outside lower left", ncols=columns, fontsize=9.5, frameon=False)


def thinned(values: Array, most: int = MOST) -> Index:
    """Indices of at most `most` samples, the smallest and the largest of each stretch, so that spikes survive."""
    N = len(values)
    if most >= N:
        return np.arange(N, dtype=np.int64)
    stretch = -(-N // max(most // 2, 1))
    rows = -(-N // stretch)
    table = np.full((rows, stretch), np.nan)
    table.ravel()[:N] = values
    missing = np.isnan(table)
    low = np.where(missing, np.inf, table).argmin(axis=1)
    high = np.where(missing, -np.inf, table).argmax(axis=1)
    starts = np.arange(rows, dtype=np.int64) * stretch
    return np.unique(np.concatenate([starts + low, starts + high]))


def thinned_runs(record: Record, values: Array, most: int = MOST) -> list[Index]:
    """`thinned` for each run, in samples of the record, each run with its share."""
    share = most / max(len(record), 1)
    spans = zip(record.bounds[:-1].tolist(), record.bounds[1:].tolist(), strict=True)
    return [first + thinned(values[first:last], max(int(share * (last - first)), 16)) for first, last in spans]


def timeline(record: Record) -> tuple[Array, Array]:
    """Where samples stand on the time axis, (N,), and what was added to each run's time, (runs,).

    A single run keeps its time; several stand one after another with a gap, since their clocks may overlap.
    """
    bounds = record.bounds
    offsets = np.zeros(len(bounds) - 1)
    if len(offsets) > 1:
        lengths = record.t[bounds[1:] - 1] - record.t[bounds[:-1]]
        begins = np.concatenate([[0.0], np.cumsum(lengths + 0.03 * lengths.sum())[:-1]])
        offsets = begins - record.t[bounds[:-1]]
    return record.t + np.repeat(offsets, np.diff(bounds)), offsets


def time_label(record: Record, model: Model) -> str:
    """The label of the time axis; the name of the file's column often carries the unit."""
    name = f"time ({model.time})" if model.time else "time t (unit of the record)"
    return name if len(record.starts) == 1 else f"{name}, {len(record.starts)} runs one after another"


def line(ax: Axes, record: Record, x: Array, y: Array, color: str, label: str, most: int = MOST) -> None:
    """A curve over time that is thinned, and broken between runs."""
    for k, kept in enumerate(thinned_runs(record, y, most)):
        ax.plot(x[kept], y[kept], color=color, linewidth=1.4, label=label if k == 0 else None, zorder=3)


def samples(
    ax: Axes, record: Record, x: Array, y: Array, color: str, label: str, most: int = MOST, size: float = 3.2
) -> None:
    """Measured values over time: dots, or where they are too many a line from each smallest to each largest.

    Dots at the extremes alone would look like two bands with nothing between them.
    """
    if len(record) <= most:
        dots(ax, x, y, color, label, size)
        return
    for k, kept in enumerate(thinned_runs(record, y, most)):
        ax.plot(x[kept], y[kept], color=color, linewidth=0.8, label=label if k == 0 else None, zorder=2)


def dots(ax: Axes, x: Array, y: Array, color: str, label: str, size: float = 3.2) -> None:
    """Points as one path of tiny strokes with round ends: a fifth of the size of one SVG element a point."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    ax.plot([], [], ".", color=color, markersize=6, label=label)
    if len(x) == 0:
        return
    tiny = 1e-4 * (float(np.ptp(x)) or 1.0)
    corners = np.column_stack([x, y, x + tiny, y]).reshape(-1, 2)
    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=Path.code_type), len(x))
    points = PathPatch(Path(corners, codes), fill=False, edgecolor=color, linewidth=size, capstyle="round", zorder=2)
    # add_patch would search each stroke for the extremes of its curve.
    ax.add_artist(points)
    ax.update_datalim(corners)
    ax.autoscale_view()
