"""Figures of where a model fails: the smoothed discrepancy over time, against a variable, and over two states."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from suite.discovery.result import Candidate, Discrepancy
from suite.discovery.state_map import FEW, bins
from suite.discovery.state_map import state_map as mapped
from suite.discovery.variable import samples
from suite.discovery.where import where
from suite.model import Model
from suite.record import Record
from suite.report.canvas import (
    BAND95,
    BLUE,
    INK,
    MOST,
    SKY,
    VERMILION,
    Array,
    dots,
    dressed,
    legend_below,
    line,
    new_figure,
    thinned,
    thinned_runs,
    time_label,
    timeline,
)
from suite.report.figures import plain


def label_of(model: Model, record: Record, name: str) -> str:
    """What the discrepancy's variable is, for an axis."""
    if name in model.states:
        return f"{name} (smoothed state)"
    if name in model.inputs:
        return f"{name} (input)"
    state = name.removesuffix("'")
    return f"rate of {state}" if state in model.states else time_label(record, model)


def discrepancy(
    model: Model, record: Record, misfit: Discrepancy, candidate: Candidate | None = None, most: int = MOST
) -> Figure:
    """The smoothed model error over time with its band, and against the variable that orders it.

    A candidate's `curve`, what its term adds to the rate at the same samples, is drawn over both.
    """
    i = list(model.states).index(misfit.equation)
    d, sd = misfit.d[:, i], misfit.d_sd[:, i]
    v, label = samples(model, record, misfit), label_of(model, record, misfit.variable)
    ylabel = f"missing in {misfit.equation}' ({misfit.equation} per time)"
    title = where(misfit, record, model)
    said = f"{100 * misfit.ratio:.0f} % of the variation of the model error is explained by {misfit.variable}"
    fig = new_figure(title, f"Smoothed model error over time and against {misfit.variable}. {said}", 6.4)
    upper, lower = fig.subplots(2, 1, height_ratios=[1.0, 1.35])
    t, _ = timeline(record)
    curve = None if candidate is None else candidate.curve
    named = "" if candidate is None else ", ".join(plain(effect.effect) for effect in candidate.effects)

    for k, kept in enumerate(thinned_runs(record, d, most)):
        low, high = d[kept] - BAND95 * sd[kept], d[kept] + BAND95 * sd[kept]
        upper.fill_between(t[kept], low, high, color=SKY, alpha=0.4, linewidth=0, label=None if k else "its 95 % band")
    line(upper, record, t, d, BLUE, "estimated model error d", most)
    if curve is not None:
        line(upper, record, t, curve, VERMILION, f"candidate: {named}", most)
    upper.axhline(0, color=INK, linewidth=0.8)
    upper.margins(x=0.01)
    dressed(upper, time_label(record, model), ylabel)

    kept = thinned(d, most)
    dots(lower, v[kept], d[kept], "#C9CED3", "d, each sample", 2.6)
    b = bins(misfit, v, record, i)
    visited = b.count > 0
    centre, mean, spread = 0.5 * (b.edges[1:] + b.edges[:-1])[visited], b.mean[visited], BAND95 * b.sd[visited]
    lower.fill_between(centre, mean - spread, mean + spread, color=SKY, alpha=0.4, linewidth=0, zorder=3)
    lower.plot(centre, mean, "o-", color=BLUE, markersize=4.5, linewidth=1.4, label="d, mean of a bin", zorder=4)
    few = b.count[visited] < FEW
    if few.any():
        said_few = f"fewer than {FEW} samples"
        lower.plot(centre[few], mean[few], "o", color=BLUE, mfc="white", markersize=4.5, label=said_few, zorder=5)
    if curve is not None:
        _fitted(lower, v, curve, f"candidate: {named}", most)
    lower.axhline(0, color=INK, linewidth=0.8)
    dressed(lower, label, ylabel, said)
    legend_below(fig, upper, lower)
    return fig


def _fitted(ax: Axes, v: Array, curve: Array, label: str, most: int) -> None:
    """A line where the term is a function of the variable, points where it depends on more than that."""
    order = np.argsort(v, kind="stable")
    x, y = v[order], curve[order]
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    kept = thinned(y, most)
    reach = float(np.ptp(y)) if len(y) else 0.0
    if reach > 0 and float(np.abs(np.diff(y)).sum()) > 8 * reach:
        dots(ax, x[kept], y[kept], VERMILION, label, 2.2)
        return
    ax.plot(x[kept], y[kept], color=VERMILION, linewidth=2.2, label=label, zorder=5)


def state_map(model: Model, misfit: Discrepancy) -> Figure | None:
    """Mean discrepancy in cells of two states, hatched where fewer than 5 samples say it; None with a single state."""
    cells = mapped(model, misfit)
    if cells is None:
        return None
    pair, ea, eb, mean, count = (cells.x, cells.y), cells.x_edges, cells.y_edges, cells.mean, cells.count
    reach = float(np.nanmax(np.abs(mean[count >= FEW]), initial=0.0)) or float(np.nanmax(np.abs(mean), initial=0.0))
    title = f"Where the equation of {misfit.equation} is wrong, over {pair[0]} and {pair[1]}"
    said = f"Mean model error of {misfit.equation} in cells of {pair[0]} and {pair[1]}; strongest {reach:.3g}"
    fig = new_figure(title, said, 5.2)
    ax = fig.subplots()
    ax.set_facecolor("#C4C8CC")
    # Orange below zero, purple above, pale at zero: told apart with every kind of colour vision.
    colours = ax.pcolormesh(
        ea,
        eb,
        mean.T,
        cmap=colormaps["PuOr"].resampled(41),
        vmin=-(reach or 1),
        vmax=reach or 1,
        edgecolors="face",
        lw=0.3,
    )
    bar = fig.colorbar(colours, ax=ax)
    bar.set_label(f"mean missing in {misfit.equation}' ({misfit.equation} per time)", fontsize=10)
    bar.ax.tick_params(labelsize=9.5)
    _hatched(ax, ea, eb, (count > 0) & (count < FEW))
    ax.margins(0)
    dressed(ax, f"{pair[0]} (smoothed state)", f"{pair[1]} (smoothed state)")
    ax.set_title(f"hatched: fewer than {FEW} samples; grey: never visited", loc="left", fontsize=10, color=INK)
    ax.grid(False)
    return fig


def _hatched(ax: Axes, ea: Array, eb: Array, cells: npt.NDArray[np.bool_]) -> None:
    """One path for all hatched cells, which is a tenth of the size of one for each."""
    corners = [
        [(ea[i], eb[j]), (ea[i + 1], eb[j]), (ea[i + 1], eb[j + 1]), (ea[i], eb[j + 1]), (ea[i], eb[j])]
        for i, j in np.argwhere(cells)
    ]
    if corners:
        path = Path.make_compound_path(*(Path(box, closed=True) for box in corners))
        ax.add_patch(PathPatch(path, facecolor="none", edgecolor="#777777", hatch="////", linewidth=0, zorder=3))
