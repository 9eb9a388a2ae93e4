"""A picture of each case: truth, estimates, model error and bands, computed again for one stored seed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suite import plugins
from suite.benchmark import hashes
from suite.benchmark.cells import experiment
from suite.benchmark.comparison import Comparison, Condition, Method
from suite.case import Case, Truth
from suite.estimator import Estimate
from suite.record import Record
from suite.report.canvas import BAND95, BLUE, INK, ORANGE, dressed, legend_below, new_figure

Array = npt.NDArray[np.float64]
Row = Mapping[str, Any]
SECONDS = 0.5  # an estimate that took longer is not computed again: a report of thirty cases stays within a minute
LOOKS = ((BLUE, "-"), (ORANGE, "--"))


@dataclass(frozen=True)
class Picture:
    """A case's figure, or why there is none."""

    case: str
    figure: Figure | None
    sentence: str


def picture(c: Comparison, case: str, most: int = 300) -> Picture:
    """The best filter and the best smoother of a case at its middle noise level, beside the truth.

    `most` bounds the points of a curve.
    """
    known = plugins.cases().get(case)
    if known is None:
        return Picture(case, None, f"{case}: the case is not installed here, so it cannot be drawn.")
    noises = sorted(noise for name, noise in c.conditions if name == case)
    at = (case, noises[len(noises) // 2])
    chosen = [found for kind in ("filter", "smoother") if (found := _best(c, at, kind)) is not None]
    if not chosen:
        return Picture(case, None, f"{case}: no method gave an estimate that is quick enough to be computed again.")
    if any(row.get("case_hash") not in (None, hashes.case(known, None)) for _, row in chosen):
        return Picture(case, None, f"{case}: the case has changed since it was run; run it again to see it.")
    seed = int(chosen[0][1]["seed"])
    record, truth = experiment(known, at[1], seed, None)
    assert truth is not None
    estimates = [(method, _estimate(known, record, method, row)) for method, row in chosen]
    drawn = [(method, found) for method, found in estimates if found is not None]
    said = f"{known.sentence} Noise {100 * at[1]:g} %, seed {seed}."
    return Picture(case, _figure(known, record, truth, drawn, most), said)


def _best(c: Comparison, at: Condition, kind: str) -> tuple[Method, Row] | None:
    """The method of this kind with the least median error here whose first seed went well and quickly."""
    found: list[tuple[float, int, Method, Row]] = []
    for method in c.methods(kind=kind):
        scores = list(c.by_seed(method, at).values())
        rows = [row for row in c.rows[method].get(at, ()) if row["status"] == "ok" and row["seconds"] < SECONDS]
        if rows and np.isfinite(np.median(scores)):
            found.append((float(np.median(scores)), len(found), method, rows[0]))
    if not found:
        return None
    _, _, method, row = min(found, key=lambda entry: entry[:2])
    return method, row


def _estimate(case: Case, record: Record, method: Method, row: Row) -> Estimate | None:
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return plugins.estimators()[method.estimator].estimate(case.deficient, record, **row["tuning"])
        except Exception:  # it went well when it was run; a plug-in changed since may fail in any way
            return None


def _figure(case: Case, record: Record, truth: Truth, drawn: list[tuple[Method, Estimate]], most: int) -> Figure:
    """Panels: the state whose rate lacks most (against its size), and its model error."""
    states = list(case.deficient.states)
    speed = np.abs(np.gradient(truth.x, record.t, axis=0)).max(axis=0)
    lack = np.sqrt(np.mean(truth.d**2, axis=0)) / np.maximum(speed, 1e-300)
    i = int(np.argmax(lack))
    kept = np.unique(np.linspace(0, len(record) - 1, min(most, len(record))).astype(int))
    names = " and ".join(method.label for method, _ in drawn)
    fig = new_figure(
        case.name,
        f"State {states[i]} and the model error of its rate over time: the truth in black, estimates with their 95 % "
        f"bands where the method states one: {names}.",
        2.6,
    )
    left, right = fig.subplots(1, 2)
    dressed(left, "time t", f"state {states[i]}")
    dressed(right, "time t", f"model error d of {states[i]}'")
    t = record.t[kept]
    for (method, e), (color, dash) in zip(drawn, LOOKS, strict=False):
        _curve(left, t, e.x[kept, i], None if e.P is None else e.P[kept, i, i], color, dash, method.label)
        if e.d is not None:
            _curve(right, t, e.d[kept, i], None if e.P_d is None else e.P_d[kept, i, i], color, dash, method.label)
    for ax, true in ((left, truth.x), (right, truth.d)):
        ax.plot(t, true[kept, i], color=INK, linewidth=1.0, label="truth", zorder=4)
        _limits(ax, true[:, i])
    legend_below(fig, left)
    return fig


def _curve(ax: Axes, t: Array, y: Array, variance: Array | None, color: str, dash: str, label: str) -> None:
    if variance is not None:
        half = BAND95 * np.sqrt(np.clip(variance, 0.0, None))
        ax.fill_between(t, y - half, y + half, color=color, alpha=0.18, linewidth=0)
    ax.plot(t, y, color=color, linestyle=dash, linewidth=1.4, label=label, zorder=3)


def _limits(ax: Axes, true: Array) -> None:
    """The truth fills half of the panel: a first transient or a wide band shall not flatten it."""
    low, high = float(true.min()), float(true.max())
    room = 0.6 * (high - low)
    if room > 0:
        now = ax.get_ylim()
        ax.set_ylim(max(now[0], low - room), min(now[1], high + room))
