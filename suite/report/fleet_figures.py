"""Figures of a fleet: how many machines lack what, and how far each is from its model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suite.fleet.ranking import FAILED, FOLLOWS, UNEXPLAINED, counts, group, judged, ratio
from suite.fleet.stored import Brief
from suite.report.bench_figures import decades
from suite.report.canvas import BLUE, GREEN, GREY, INK, ORANGE, SKY, VERMILION, dressed, legend_below, new_figure

# Colour and marker of the most frequent effects; colour alone is not seen by all.
LOOKS = ((VERMILION, "o"), (BLUE, "s"), (GREEN, "^"), (ORANGE, "D"), (SKY, "v"))
OTHER, APART, RIGHT = (INK, "P"), ("#CC79A7", "X"), (GREY, ".")
POINTS = 1500  # machines drawn one by one, at about 90 bytes each
ALL = 150  # of the worst, all of which are drawn
BARS = 14


def bars(briefs: Sequence[Brief]) -> Figure:
    """Machines by what they lack, named and most likely."""
    table = counts(briefs)
    shown = dict(list(table.items())[:BARS]) if len(table) <= BARS else _shortened(table)
    lacking = sum(sum(pair) for name, pair in table.items() if name not in (FOLLOWS, FAILED))
    fig = new_figure(
        f"{lacking} of {len(briefs)} machines are not what the model says",
        "Bars, machines by what their model lacks: " + "; ".join(f"{n}: {_count(*pair)}" for n, pair in shown.items()),
        1.3 + 0.36 * len(shown),
    )
    ax = dressed(fig.subplots(), "machines", "")
    looks = _looks(briefs)
    for k, (name, (sure, likely)) in enumerate(shown.items()):
        color = GREY if name == FAILED else looks.get(name, OTHER)[0]
        ax.barh(k, sure, color=color, height=0.66)
        ax.barh(k, likely, left=sure, color="white", edgecolor=color, hatch="///", height=0.66, linewidth=1.2)
        ax.annotate(
            _count(sure, likely), (sure + likely, k), (5, 0), textcoords="offset points", va="center", fontsize=9.5
        )
    ax.set_yticks(range(len(shown)), list(shown))
    ax.invert_yaxis()
    ax.set_xlim(0, 1.22 * max(map(sum, shown.values())))
    ax.grid(False, axis="y")
    if any(likely for _, likely in shown.values()):
        ax.barh(0, 0, color=GREY, label="named")
        ax.barh(0, 0, color="white", edgecolor=GREY, hatch="///", label="most likely of several")
        legend_below(fig, ax)
    return fig


def _count(sure: int, likely: int) -> str:
    if not likely:
        return str(sure)
    return f"{sure} + {likely} likely" if sure else f"{likely} likely"


def _shortened(table: Mapping[str, tuple[int, int]]) -> dict[str, tuple[int, int]]:
    """The most frequent effects, the others together, and the groups that are no effect."""
    last = {name: pair for name, pair in table.items() if name in (UNEXPLAINED, FOLLOWS, FAILED)}
    effects = [item for item in table.items() if item[0] not in last]
    kept, rest = effects[: BARS - 4], effects[BARS - 4 :]
    together = (sum(pair[0] for _, pair in rest), sum(pair[1] for _, pair in rest))
    return {**dict(kept), f"{len(rest)} other kinds": together, **last}


def _looks(briefs: Sequence[Brief]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each group that has its own."""
    effects = [name for name in counts(briefs) if name not in (UNEXPLAINED, FOLLOWS, FAILED)]
    return {**dict(zip(effects, LOOKS, strict=False)), UNEXPLAINED: APART, FOLLOWS: RIGHT}


def ranking(briefs: Sequence[Brief]) -> Figure | None:
    """Error over noise of every judged machine, the worst first; None where none was judged."""
    told = judged(briefs)
    if not told:
        return None
    kept = _kept(len(told))
    thinned = f" {len(kept)} of {len(told)} are drawn, the worst {ALL} all of them." if len(kept) < len(told) else ""
    worst, middle = told[0], told[len(told) // 2]
    fig = new_figure(
        f"Worst machine: {_times(worst.ratio)}; middle one: {_times(middle.ratio)}",
        "Error of the calibrated model over the sensor noise, of each machine, the worst at the left; 1 is a model "
        f"that is right to the noise. Colour and marker say what is missing; hollow: likeliest of several.{thinned}",
        4.4,
    )
    ax = dressed(fig.subplots(), "machine, by rank", "error over noise, largest of its outputs")
    ax.set_yscale("log")
    finite = [brief.ratio for brief in told if 0 < brief.ratio < np.inf]
    top = 2.0 * max(finite, default=1.0)
    looks = _looks(briefs)
    members: dict[tuple[tuple[str, str], str, bool], list[tuple[int, float]]] = {}
    for k in kept:
        name, certain = group(told[k])
        label = name if name in looks else "another effect"
        at = (k + 1, min(max(told[k].ratio, 1e-3), top))
        members.setdefault((looks.get(name, OTHER), label, certain), []).append(at)
    for ((color, marker), label, certain), points in sorted(members.items(), key=lambda item: not item[0][2]):
        face = color if certain else "none"
        ax.plot(*zip(*points, strict=True), marker, color=color, markerfacecolor=face, markersize=5, zorder=3)
        ax.plot([], [], marker, color=color, markersize=6, label=label)
    ax.axhline(1.0, color=INK, linewidth=0.9)
    ax.annotate("the noise", (1.0, 1.0), (-4, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
                ha="right", fontsize=9)  # fmt: skip
    _ran_away(ax, told, top)
    decades(ax.yaxis)
    legend_below(fig, ax)
    return fig


def _kept(count: int) -> list[int]:
    """Which machines are drawn: all of the worst, the others evenly."""
    if count <= POINTS:
        return list(range(count))
    evenly = np.linspace(ALL, count - 1, POINTS - ALL).round().astype(int).tolist()
    return [*range(ALL), *dict.fromkeys(evenly)]


def _times(value: float) -> str:
    return "runs away in simulation" if np.isinf(value) else f"{ratio(value)} times the noise"


def _ran_away(ax: Axes, told: Sequence[Brief], top: float) -> None:
    """Say which points stand at the upper edge for what has no number."""
    lost = sum(np.isinf(brief.ratio) for brief in told)
    if lost:
        ax.axhline(top, color=GREY, linestyle=":", linewidth=0.9)
        ax.annotate(f"{lost} ran away in simulation", (1.0, top), (-4, -12), xycoords=("axes fraction", "data"),
                    textcoords="offset points", ha="right", fontsize=9)  # fmt: skip
