"""Figures that rank the methods: performance profile, critical differences, accuracy against run time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suite.benchmark.comparison import Comparison, Method
from suite.benchmark.ranking import cliques, critical_difference, friedman, front, profile
from suite.report.bench_figures import COLORS, GREY, MARKERS, decades
from suite.report.canvas import BLUE, INK, ORANGE, dressed, legend_below, new_figure

Array = npt.NDArray[np.float64]
VARIANTS = {"default": "as shipped", "tuned": "tuned"}
NAMED = 7  # curves with a colour; the others are drawn in grey
DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))


def performance_profile(c: Comparison) -> Figure:
    """Share of conditions within a factor of the best, a panel a variant."""
    factors = np.geomspace(1.0, 100.0, 160)
    fig = new_figure(
        "How often is each method within a factor of the best?",
        "Performance profile: share of conditions on which the state error of a method is at most tau times the "
        "smallest error of all methods in the panel; higher is better, the left end says how often it is the best, "
        "the right end how often it gives a number at all.",
        4.2,
    )
    axes = fig.subplots(1, 2, sharey=True)
    for ax, (variant, words) in zip(axes, VARIANTS.items(), strict=True):
        methods = c.methods(variant)
        dressed(ax, "tau: state error over the best method's", "share of conditions", words)
        ax.set_xscale("log")
        ax.set_xlim(1.0, 100.0)
        ax.set_ylim(-0.02, 1.02)
        ax.set_xticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
        ax.minorticks_off()
        if methods:
            _curves(ax, methods, profile(c.medians(methods), factors), factors)
    return fig


def _curves(ax: Axes, methods: Sequence[Method], shares: Array, factors: Array) -> None:
    # The area under the curve (in log tau) orders them; the best get a colour and their name.
    area = shares.mean(axis=1)
    order = np.argsort(-area, kind="stable").tolist()
    for i in order[NAMED:][::-1]:
        ax.plot(factors, shares[i], color="0.8", linewidth=0.9, drawstyle="steps-post")
    for k, i in enumerate(order[:NAMED]):
        look: Any = {"color": COLORS[k], "linestyle": DASHES[k]}
        ax.plot(factors, shares[i], linewidth=1.8, label=methods[i].estimator, drawstyle="steps-post", **look)
    if len(order) > NAMED:
        ax.plot([], [], color="0.8", label=f"{len(order) - NAMED} others")
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), fontsize=8.5, frameon=False, ncols=2)


def critical_differences(c: Comparison, variant: str) -> Figure | None:
    """Mean ranks on a line, bars joining those that do not differ significantly; None below two methods or cases."""
    methods = c.methods(variant)
    if len(methods) < 2 or len(c.cases) < 2:
        return None
    ranks = c.ranks(methods)
    means = ranks.mean(axis=1)
    k, N = ranks.shape
    width = critical_difference(k, N)
    groups = cliques(means.tolist(), width)
    half = -(-k // 2)
    p = friedman(ranks)
    fig = new_figure(
        f"Which methods differ in mean rank, {VARIANTS[variant]}?",
        f"Critical-difference diagram: mean rank by state error of {k} methods over {N} cases, best at the left; "
        f"Friedman p = {p:.2g}; a bar joins methods whose mean ranks differ by less than Nemenyi's critical "
        f"difference {width:.1f} at 5 %.",
        1.6 + 0.25 * half + 0.14 * len(groups),
    )
    ax = fig.subplots()
    room = 0.5 + 0.32 * len(groups)
    ax.set_xlim(0.5 - 0.32 * k, k + 0.5 + 0.32 * k)
    ax.set_ylim(-room - 0.62 * half - 0.3, 2.1)
    ax.axis("off")
    ax.plot([1, k], [0, 0], color=INK, linewidth=1)
    for rank in range(1, k + 1):
        ax.plot([rank, rank], [0, 0.15], color=INK, linewidth=1)
        if k <= 14 or rank % 2 == 1:
            ax.text(rank, 0.25, str(rank), ha="center", va="bottom", fontsize=8.5)
    shown = min(width, float(k - 1))
    ax.plot([1, 1 + shown], [1.35, 1.35], color=BLUE, linewidth=2, solid_capstyle="butt")
    more = "" if width <= k - 1 else ", more than all ranks: too few cases"
    ax.text(1, 1.5, f"critical difference {width:.1f}{more}", color=BLUE, fontsize=9, va="bottom")
    for level, (first, last) in enumerate(groups):
        y = -0.4 - 0.32 * level
        ax.plot([means[first] - 0.06, means[last] + 0.06], [y, y], color=ORANGE, linewidth=3.5, solid_capstyle="butt")
    for i, (method, mean) in enumerate(zip(methods, means, strict=True)):
        left = i < half
        y = -room - 0.62 * (i if left else k - 1 - i) - 0.2
        edge = 0.5 - 0.02 * k if left else k + 0.5 + 0.02 * k
        ax.plot([mean, mean, edge], [0, y, y], color=GREY, linewidth=0.7)
        place: Any = {"ha": "right" if left else "left", "va": "center", "fontsize": 9}
        called = method.estimator + (" (smoother)" if method.kind == "smoother" else "")
        name = f"{called}  {mean:.1f}" if left else f"{mean:.1f}  {called}"
        ax.text(edge + (-0.01 * k if left else 0.01 * k), y, name, **place)
    return fig


def pareto(c: Comparison) -> Figure | None:
    """Accuracy against run time over all conditions, with the Pareto front; None without a reference."""
    reference = c.reference
    if reference is None:
        return None
    points: dict[Method, tuple[float, float]] = {}
    for method in c.rows:
        ratio, cost = c.over_cases(method, reference), c.median_of(method, "step_us")
        if ratio is not None and cost is not None and np.isfinite(ratio[0]) and ratio[0] > 0:
            points[method] = (cost, ratio[0])
    if not points:
        return None
    fig = new_figure(
        "What does accuracy cost?",
        "Median run time a step against the state error over that of the EKF as shipped (median over cases); "
        "hollow as shipped, filled tuned. The line is the Pareto front: no method is both faster and more accurate "
        "than one on it.",
        5.4,
    )
    ax = dressed(fig.subplots(), "run time a step [microseconds], median", "state error / EKF's as shipped")
    ax.set_xscale("log")
    ax.set_yscale("log")
    decades(ax.xaxis)
    decades(ax.yaxis)
    line = front(points)
    steps = [points[m] for m in line]
    right = 1.3 * max(cost for cost, _ in points.values())
    ax.step(
        [x for x, _ in steps] + [right], [y for _, y in steps] + [steps[-1][1]], where="post", color=GREY, linewidth=1
    )
    names = list(dict.fromkeys(m.estimator for m in sorted(points, key=lambda m: points[m][1])))
    for k, name in enumerate(names):
        look: Any = {"color": COLORS[k % len(COLORS)], "marker": MARKERS[k % len(MARKERS)], "ms": 7, "ls": ""}
        ax.plot([], [], label=name, **look)
        for method in (m for m in points if m.estimator == name):
            face = "none" if method.variant == "default" else look["color"]
            ax.plot(*points[method], markerfacecolor=face, zorder=3, **look)
    for method in line:
        ax.annotate(method.label, points[method], (6, -11), textcoords="offset points", fontsize=8.5, color=INK)
    legend_below(fig, ax)
    return fig
