"""Whether the methods know how wrong they are: NEES, NIS, coverage and whiteness by method over conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from suite.benchmark.comparison import Comparison, Method
from suite.report.canvas import BLUE, INK, ORANGE, dressed, legend_below, new_figure


@dataclass(frozen=True)
class Gauge:
    """A number that a consistent method has at `right`; values beyond the limits are drawn at them."""

    field: str
    label: str
    right: float
    low: float
    high: float
    log: bool


GAUGES = (
    Gauge("nees", "NEES / states", 1.0, 1e-2, 1e3, True),
    Gauge("nis", "NIS / outputs", 1.0, 1e-2, 1e3, True),
    Gauge("coverage", "inside the 95 % band", 0.95, 0.0, 1.0, False),
    Gauge("innovation_r1", "innovation correlation", 0.0, -1.0, 1.0, False),
)
SPANNED = (0.05, 0.25, 0.5, 0.75, 0.95)


def consistency(c: Comparison) -> Figure | None:
    """Where nine of ten, half, and the middle of the conditions lie (each its median over seeds); None where no method
    states a covariance.
    """
    methods = c.methods()
    values = {g.field: {m: _medians(c, m, g.field) for m in methods} for g in GAUGES}
    gauges = [g for g in GAUGES if any(values[g.field].values())]
    names = [m for m in methods if any(values[g.field][m] for g in gauges)]
    if not gauges or not names:
        return None
    fig = new_figure(
        "Do the methods know how wrong they are?",
        "By method, best mean rank at the top: nine of ten conditions lie on the thin line, half of them on the thick "
        "one, the stroke is their median; the dashed line is where a consistent method lies. NEES or NIS above 1, "
        "coverage below 0.95: the method is surer than it may be. Innovations that correlate with their "
        "neighbours: the filter leaves structure unexplained.",
        1.4 + 0.19 * len(names),
    )
    axes = fig.subplots(1, len(gauges), sharey=True, squeeze=False)[0]
    for ax, gauge in zip(axes, gauges, strict=True):
        dressed(ax, gauge.label, "")
        ax.axvline(gauge.right, color=INK, linestyle="--", linewidth=1)
        if gauge.log:
            ax.set_xscale("log")
            ax.set_xticks([0.01, 0.1, 1.0, 10.0, 100.0, 1000.0], ["0.01", "", "1", "", "100", ""])
            ax.minorticks_off()
        ax.set_xlim(gauge.low, gauge.high)
        for i, method in enumerate(names):
            found = np.clip(values[gauge.field][method], gauge.low, gauge.high)
            if len(found) == 0:
                continue
            color = ORANGE if method.variant == "default" else BLUE
            least, lower, middle, upper, most = np.quantile(found, SPANNED)
            ax.plot([least, most], [i, i], color=color, linewidth=0.9, clip_on=False)
            ax.plot([lower, upper], [i, i], color=color, linewidth=3.6, alpha=0.6, solid_capstyle="butt", clip_on=False)
            ax.plot(middle, i, "|", color=color, markersize=9, markeredgewidth=2.2, clip_on=False)
    axes[0].set_yticks(range(len(names)), [m.label for m in names], fontsize=8.5)
    axes[0].set_ylim(len(names) - 0.4, -0.6)
    axes[0].plot([], [], color=ORANGE, linewidth=3.6, alpha=0.6, label="as shipped")
    axes[0].plot([], [], color=BLUE, linewidth=3.6, alpha=0.6, label="tuned")
    legend_below(fig, axes[0])
    return fig


def _medians(c: Comparison, method: Method, field: str) -> list[float]:
    """The median over seeds under each condition, where there is one."""
    found = []
    for at in c.conditions:
        rows = c.rows[method].get(at, ())
        values = [row[field] for row in rows if row["status"] == "ok" and row.get(field) is not None]
        values = [value for value in values if np.isfinite(value)]
        if values:
            found.append(float(np.median(values)))
    return found
