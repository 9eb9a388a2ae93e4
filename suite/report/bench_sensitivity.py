"""How much each tuned number matters: the tuner's own scores against the value, a curve a case."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from suite import plugins
from suite.report.bench_figures import GREY
from suite.report.canvas import BLUE, VERMILION, dressed, legend_below, new_figure

Array = npt.NDArray[np.float64]
ACROSS = 3
WORST = 100.0  # scores are drawn up to this many times the best


def points(tunings: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Each evaluated point of each tuning as a flat line: case, noise, estimator, score and the values.

    A later tuning of the same case, noise and estimator replaces an earlier one.
    """
    newest = {(t["case"], t["noise"], t["estimator"]): t for t in tunings if t.get("points")}
    return [
        {"case": case, "noise": noise, "estimator": estimator, "score": point["score"], **_whole(estimator, point)}
        for (case, noise, estimator), tuning in sorted(newest.items())
        for point in tuning["points"]
    ]


def _whole(estimator: str, point: Mapping[str, Any]) -> dict[str, float]:
    """The values of a point; the default's are those of the signature."""
    values: dict[str, float] = dict(point["values"])
    return values or defaults(estimator)


def defaults(name: str) -> dict[str, float]:
    """The shipped values of an estimator's tuned numbers; {} where it is not installed."""
    estimator = plugins.estimators().get(name)
    if estimator is None:
        return {}
    known = inspect.signature(estimator.estimate).parameters
    found = {key: known[key].default for key in estimator.tuning if key in known}
    return {key: float(value) for key, value in found.items() if isinstance(value, (int, float))}


def envelope(values: Array, scores: Array, log: bool) -> tuple[Array, Array]:
    """The lowest score near each value, rising: with several tuned numbers the others are as good as they were tried.

    Of at most 12 stretches of equal width (of the logarithm) the best point each.
    """
    place = np.log(values) if log else values
    width = max(float(np.ptp(place)), 1e-12) / 12
    stretch = np.minimum(((place - place.min()) / width).astype(int), 11)
    kept = [int(np.flatnonzero(stretch == s)[np.argmin(scores[stretch == s])]) for s in np.unique(stretch)]
    return values[kept], scores[kept]


def sensitivity(lines: Sequence[Mapping[str, Any]]) -> Figure | None:
    """A panel a tuned number of an estimator, a curve a case at its middle noise level; None without points."""
    panels: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for line in lines:
        for name in line:
            if name not in ("case", "noise", "estimator", "score"):
                panels.setdefault((line["estimator"], name), []).append(line)
    if not panels:
        return None
    down = -(-len(panels) // ACROSS)
    fig = new_figure(
        "How much does each tuned number matter?",
        "The tuner's score over the best score of the case, against the value: a thin curve is a case at its middle "
        f"noise level, the thick one their median; a value at which the method failed is drawn at {WORST:g}. Flat: the "
        "number hardly matters; a narrow valley: it must be tuned. Dashed: the value as shipped.",
        0.9 + 2.0 * down,
    )
    axes = fig.subplots(down, ACROSS, sharey=True, squeeze=False).ravel()
    for ax, ((estimator, name), found) in zip(axes, sorted(panels.items()), strict=False):
        _panel(ax, estimator, name, found)
    for ax in axes[len(panels) :]:
        ax.axis("off")
    legend_below(fig, axes[0])
    return fig


def _panel(ax: Axes, estimator: str, name: str, lines: Sequence[Mapping[str, Any]]) -> None:
    dressed(ax, name, "score / best", estimator)
    log = all(line[name] > 0 for line in lines if line.get(name) is not None)
    low, high = (f(line[name] for line in lines) for f in (min, max))
    if log:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(numticks=5))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_yscale("log")
    ax.set_ylim(0.9, WORST * 1.3)
    ax.set_yticks([1.0, 10.0, 100.0], ["1", "10", "100"])
    ax.minorticks_off()
    grid = np.geomspace(low, high, 40) if log else np.linspace(low, high, 40)
    curves = []
    for case in dict.fromkeys(line["case"] for line in lines):
        noises = sorted({line["noise"] for line in lines if line["case"] == case})
        mine = [line for line in lines if (line["case"], line["noise"]) == (case, noises[len(noises) // 2])]
        values = np.array([line[name] for line in mine], dtype=np.float64)
        scores = np.array([np.inf if line["score"] is None else line["score"] for line in mine])
        if not np.isfinite(scores).any() or scores.min() <= 0:
            continue
        values, scores = envelope(values, np.minimum(scores / scores.min(), WORST), log)
        ax.plot(values, scores, color=GREY, linewidth=0.7, alpha=0.6, label="a case")
        place = np.log(values) if log else values
        curves.append(np.interp(np.log(grid) if log else grid, place, np.log(scores)))
    if curves:
        ax.plot(grid, np.exp(np.median(curves, axis=0)), color=BLUE, linewidth=2.2, label="median of cases")
    shipped = defaults(estimator).get(name)
    if shipped is not None and (shipped > 0 or not log):
        ax.axvline(shipped, color=VERMILION, linestyle="--", linewidth=1, label="as shipped")
