"""A picture of each effect: a typical motion, what the effect adds along it, and that against its variable."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suite.effect import Effect
from suite.report.canvas import BLUE, GREY, INK, VERMILION, Array, Index, dressed, legend_below, new_figure, wrapped
from suite.report.effect_trace import Trace, trace
from suite.report.figures import plain

POINTS = 330  # of a curve over time
GRID = 160  # of a curve that follows its variable alone
NAMES = {
    "other": "another state", "source": "the other store", "position": "position", "angle": "angle", "rate": "rate",
    "temperature": "temperature", "deviation": "deviation from its level", "state": "state", "content": "content",
    "any": "state",
    "output": "true reading", "input": "input", "parameter": "parameter", "fixed": "parameter", "clock": "a state",
}  # fmt: skip
# What stands without the effect, and what with it.
READ = {
    "output": ("without", "as the sensor reads"), "input": ("as recorded", "as it acts"),
    "parameter": ("in the model", "in the plant"), "fixed": ("in the model", "in the plant"),
    "clock": ("as the model runs", "as the plant runs"),
}  # fmt: skip


def effect_figure(effect: Effect) -> Figure:
    """The picture of one effect. ModelError where its text cannot be read."""
    found = trace(effect)
    title = plain(effect.id).capitalize()
    if found.before is None or found.after is None:
        return _in_rate(effect, found, title)
    return _elsewhere(effect, found, found.before, found.after, title)


def _in_rate(effect: Effect, found: Trace, title: str) -> Figure:
    what, missing = variable(effect, found), f"d, missing in {target(effect)}'"
    said = f"What {effect.term} adds to the rate of {target(effect)} along a typical motion, and that against {what}."
    if found.label == "t":
        fig = new_figure(title, said, 2.9)
        ax = fig.subplots()
        _over_time(ax, found.t, found.d, BLUE, missing)
        ax.set_title(wrapped(formula(effect, found), 52), loc="left", fontsize=10, color=INK)
        return fig
    fig = new_figure(title, said, 3.6)
    grid = fig.add_gridspec(2, 2, height_ratios=[1.0, 1.3])
    upper, lower = fig.add_subplot(grid[0, 0]), fig.add_subplot(grid[1, 0])
    _over_time(upper, found.t, found.variable, GREY, found.label, below=False)
    _over_time(lower, found.t, found.d, BLUE, missing)
    right = fig.add_subplot(grid[:, 1])
    _against(right, found, found.variable, found.d, what, missing)
    right.set_title(wrapped(formula(effect, found), 52), loc="left", fontsize=10, color=INK)
    return fig


def _elsewhere(effect: Effect, found: Trace, before: Array, after: Array, title: str) -> Figure:
    """Before and after over time; for a sensor also what it reads against what is true."""
    without, with_it = READ[found.place]
    letter = next(letter for letter, role in effect.roles.items() if role == found.place)
    what = f"{NAMES[found.place]} {letter}"
    said = f"The {NAMES[found.place]} {without} and {with_it}, where {effect.term} acts on it."
    fig = new_figure(title, said, 3.4)
    beside = found.place == "output"
    grid = fig.add_gridspec(1, 2 if beside else 1, width_ratios=[1.5, 1.0] if beside else None)
    first = fig.add_subplot(grid[0, 0])
    rest = [fig.add_subplot(grid[0, 1])] if beside else []
    kept = _kept(found)
    first.plot(found.t[kept], before[kept], color=GREY, linewidth=1.6, label=without)
    first.plot(found.t[kept], after[kept], color=VERMILION, linewidth=1.4, label=with_it)
    _framed(first, np.concatenate([before, after]))
    dressed(first, "time t", "reading" if beside else what)
    for ax in rest:
        _against(ax, found, before, after, what, "reading", straight=True)
    first.set_title(wrapped(formula(effect, found), 52), loc="left", fontsize=10, color=INK)
    legend_below(fig, first, *rest)
    return fig


def formula(effect: Effect, found: Trace) -> str:
    """The term as text, with the inner scales at which it is drawn; the rates of its states stand in the page."""
    scales = "".join(f", {name}={value:.2g}" for name, value in found.scales.items())
    letter = next((letter for letter, role in effect.roles.items() if role == found.place), "")
    sign, rest = effect.term[0], effect.term[1:]
    match found.place:
        case "rate":
            return f"d = {effect.term.removeprefix('+')}{scales}"
        case "clock":
            return f"every rate times (1 {sign} {rest}){scales}"
        case _:
            return f"{letter} becomes {letter} {sign} {rest}{scales}"


def variable(effect: Effect, found: Trace) -> str:
    """What the picture is drawn against, in words and letter."""
    role = effect.roles.get(found.label)
    return f"{NAMES[role]} {found.label}" if role in NAMES else f"time {found.label}"


def target(effect: Effect) -> str:
    """The letter of the state in whose rate the effect acts."""
    for role in ("rate", "state", "content", "any"):
        for letter, played in effect.roles.items():
            if played == role:
                return letter
    return "x"


def _over_time(ax: Axes, t: Array, values: Array, color: str, label: str, below: bool = True) -> None:
    kept = np.unique(np.linspace(0, len(t) - 1, POINTS).astype(int))
    ax.axhline(0, color=INK, linewidth=0.7)
    ax.plot(t[kept], values[kept], color=color, linewidth=1.4)
    _framed(ax, values)
    dressed(ax, "time t" if below else "", label)
    ax.tick_params(labelbottom=below)


def _against(ax: Axes, found: Trace, x: Array, y: Array, xlabel: str, ylabel: str, straight: bool = False) -> None:
    """The curve of y over x; where y does not follow x alone, the way that the motion takes."""
    if straight:
        ends = [float(x.min()), float(x.max())]
        ax.plot(ends, ends, color=GREY, linewidth=1.6)
    else:
        ax.axhline(0, color=INK, linewidth=0.7)
        if x.min() < 0:
            ax.axvline(0, color=INK, linewidth=0.7)
    if found.path:
        kept = _kept(found)
        ax.plot(x[kept], y[kept], color=VERMILION if straight else BLUE, linewidth=1.2)
    else:
        order = np.argsort(x, kind="stable")
        grid = np.linspace(x.min(), x.max(), GRID)
        ax.plot(grid, np.interp(grid, x[order], y[order]), color=VERMILION if straight else BLUE, linewidth=2.0)
    _framed(ax, np.concatenate([x, y]) if straight else y)
    dressed(ax, xlabel, ylabel)


def _kept(found: Trace) -> Index:
    """Samples to draw: evenly spread, with both sides of a jump of the input."""
    kept = np.linspace(0, len(found.t) - 1, POINTS).astype(int)
    if found.before is not None:
        for curve in (found.before, found.after):
            jumps = np.flatnonzero(np.abs(np.diff(curve)) > 0.1) if curve is not None else kept[:0]
            kept = np.concatenate([kept, jumps, jumps + 1])
    return np.unique(kept)


def _framed(ax: Axes, values: Array) -> None:
    """A little room, and for what never changes some height around it and zero."""
    values = values[np.isfinite(values)]
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-9 * max(abs(high), 1e-300):
        low, high = min(low, 0.0), max(high, 0.0)
    room = 0.12 * ((high - low) or 1.0)
    ax.set_ylim(low - room, high + room)
    ax.locator_params(axis="y", nbins=4)
    ax.locator_params(axis="x", nbins=6)
