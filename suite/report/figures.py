"""Figures of a run of discovery: how the model compares, what may be missing, and how the error falls to the noise."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from suite.discovery.misfit import residual
from suite.discovery.result import Candidate, Comparison, Ledger, Step, Verdict
from suite.model import Model
from suite.record import Record
from suite.report.canvas import (
    BAND95,
    BLUE,
    GREEN,
    INK,
    MOST,
    ORANGE,
    SKY,
    VERMILION,
    Array,
    dressed,
    legend_below,
    line,
    new_figure,
    samples,
    time_label,
    timeline,
    wrapped,
)

SEPARABLE = 16.0


def finite(Y: Array) -> Array:
    """A simulation without what left every scale when it diverged (NaN there), so that the rest can be drawn."""
    return np.where(np.abs(Y) < 1e100, Y, np.nan)


def compare(model: Model, record: Record, comparison: Comparison, most: int = MOST) -> Figure:
    """Measured (dots) beside simulated (line) for each output, and below it their difference in units of the noise."""
    names = list(model.outputs)
    fig = new_figure(_judged(comparison), _spoken(comparison), 0.9 + 3.5 * len(names))
    grid = fig.add_gridspec(2 * len(names), 1, height_ratios=[1.8, 1.0] * len(names))
    t, offsets = timeline(record)
    e = residual(model, record, comparison.Y, comparison.sigma)
    shown = []
    for j, name in enumerate(names):
        upper = fig.add_subplot(grid[2 * j])
        lower = fig.add_subplot(grid[2 * j + 1], sharex=upper)
        samples(upper, record, t, record.y[:, j], "#6A6A6A", "measured", most)
        Y = finite(comparison.Y[:, j])
        line(upper, record, t, Y, VERMILION, "simulated", most)
        _framed(upper, record.y[:, j], Y)
        times = comparison.error[name] / comparison.sigma[j] if comparison.sigma[j] > 0 else np.nan
        said = f"{name}: fit {comparison.fit[name]:.1f} %, error {comparison.error[name]:.3g}"
        dressed(upper, "", name, said + (f", {_times(times)} the noise" if np.isfinite(times) else ""))
        upper.tick_params(labelbottom=False)
        lower.axhspan(-BAND95, BAND95, color=GREEN, alpha=0.25, linewidth=0, label="noise, 95 %")
        samples(lower, record, t, e[:, j], BLUE, "measured - simulated", most, 2.4)
        dressed(lower, time_label(record, model) if j == len(names) - 1 else "", "residual / noise")
        for ax in (upper, lower):
            for k, (run, first, last) in enumerate(_merged(record, comparison)):
                label = "worst intervals" if k == 0 else None
                ax.axvspan(first + offsets[run], last + offsets[run], color=ORANGE, alpha=0.2, linewidth=0, label=label)
        upper.margins(x=0.01)
        shown += [upper, lower]
    fig.align_ylabels(shown)
    legend_below(fig, *shown)
    return fig


def _merged(record: Record, comparison: Comparison) -> list[tuple[int, float, float]]:
    """The worst intervals, neighbours as one."""
    merged: list[tuple[int, float, float]] = []
    for run, first, last in sorted(comparison.worst):
        between = record.runs[run].t
        if merged and merged[-1][0] == run and not ((between > merged[-1][2]) & (between < first)).any():
            merged[-1] = (run, merged[-1][1], last)
        else:
            merged.append((run, first, last))
    return merged


def _times(ratio: float) -> str:
    return f"{ratio:.2f} times" if ratio < 2 else f"{ratio:.2g} times" if ratio < 100 else f"{ratio:.0f} times"


def _judged(comparison: Comparison) -> str:
    """The worst output in a sentence, where the comparison itself says none."""
    pairs = zip(comparison.error.items(), comparison.sigma, strict=False)
    ratios = {name: error / sigma for (name, error), sigma in pairs if sigma > 0}
    if not ratios:
        return "The free-run simulation beside the measurements"
    worst = max(ratios, key=lambda name: ratios[name])
    if ratios[worst] < 1.15:
        return "The simulation differs from the measurements by no more than the noise"
    return f"The simulation of {worst} misses by {_times(ratios[worst])} the noise"


def _framed(ax: Axes, measured: Array, simulated: Array) -> None:
    """Limits that show all that was measured, and of a simulation that runs away only the beginning."""
    low, high = float(np.nanmin(measured, initial=np.inf)), float(np.nanmax(measured, initial=-np.inf))
    if not low <= high:
        return
    span = (high - low) or max(abs(high), 1.0)
    bottom = max(float(np.nanmin(simulated, initial=low)), low - 1.5 * span)
    top = min(float(np.nanmax(simulated, initial=high)), high + 1.5 * span)
    margin = 0.05 * (max(top, high) - min(bottom, low) or span)
    ax.set_ylim(min(bottom, low) - margin, max(top, high) + margin)


def _spoken(comparison: Comparison) -> str:
    said = [
        f"output {name}: fit {comparison.fit[name]:.1f} percent, error {comparison.error[name]:.3g}, noise {sigma:.3g}"
        for name, sigma in zip(comparison.error, comparison.sigma, strict=False)
    ]
    return "Measured and simulated outputs over time, residuals below. " + "; ".join(said)


def change(steps: tuple[Step, ...], at: int) -> str:
    """What step `at` did to the model of the step before, in a few words."""
    if at == 0:
        return "as given, refitted"
    before, now = steps[at - 1], steps[at]
    if str(before.model) == str(now.model):
        return "refitted"
    if before.verdict is not None and before.verdict.effects:
        return "+ " + ", ".join(f"{plain(named.effect)} in {named.equation}" for named in before.verdict.effects)
    return "amended"


def plain(effect: str) -> str:
    """An effect's id as words."""
    return effect.replace("_", " ")


def waterfall(ledger: Ledger) -> Figure:
    """Error of each step by output, on the fitted and on held-out data, with the noise as a line."""
    steps, names = ledger.steps, list(ledger.steps[0].model.outputs)
    first, last = steps[0].comparison, steps[-1].comparison
    ratio, worst = max((last.error[n] / s if s > 0 else np.inf, n) for n, s in zip(names, last.sigma, strict=True))
    title = (
        "The error falls to the noise"
        if ratio < 1.15 and len(steps) > 1
        else "The error is noise from the start"
        if ratio < 1.15
        else f"The error of {worst} ends at {_times(ratio)} the noise"
        if np.isfinite(ratio)
        else "The error of each step"
    )
    said = "; ".join(f"{name}: from {first.error[name]:.3g} to {last.error[name]:.3g}" for name in names)
    fig = new_figure(title, f"Error of each step by output, with the noise as a line. {said}", 0.9 + 2.5 * len(names))
    axes = fig.subplots(len(names), 1, squeeze=False)[:, 0]
    at = np.arange(len(steps), dtype=np.float64)
    labels = [wrapped(change(steps, k), max(96 // len(steps), 14)) for k in range(len(steps))]
    for j, (ax, name) in enumerate(zip(axes, names, strict=True)):
        noise = float(last.sigma[j])
        series = {"error on the fitted data": (BLUE, [step.comparison.error[name] for step in steps])}
        if any(name in step.held_out for step in steps):
            series["error on held-out data"] = (ORANGE, [step.held_out.get(name, np.nan) for step in steps])
        width = 0.7 / len(series)
        small = 9.5 if len(series) * len(steps) <= 8 else 7.5
        top = max((v for _, values in series.values() for v in values if np.isfinite(v)), default=noise or 1.0)
        logarithmic = noise > 0 and top / noise > 20
        for k, (label, (color, values)) in enumerate(series.items()):
            places = at + (k - (len(series) - 1) / 2) * width
            heights = [value if np.isfinite(value) else 0.0 for value in values]
            ax.bar(places, heights, width=0.92 * width, color=color, label=label)
            for place, value in zip(places, values, strict=True):
                if not np.isnan(value):
                    said, height = (f"{value:.3g}", value) if np.isfinite(value) else ("diverged", noise)
                    ax.annotate(
                        said, (place, height), (0, 4), textcoords="offset points", ha="center", fontsize=small,
                        # The noise's line stops at the number.
                        zorder=5, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3},
                    )  # fmt: skip
        if noise > 0:
            ax.axhline(noise, color=INK, linestyle="--", linewidth=1.3, label="noise", zorder=4)
        if logarithmic:
            ax.set_yscale("log")
            # The scale's own labels are formulas, and text is drawn as text.
            ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            ax.yaxis.set_minor_formatter(NullFormatter())
            ax.set_ylim(noise / 3, 3 * top)
        else:
            ax.set_ylim(0, 1.18 * max(top, noise))
        ax.set_xlim(-0.6, len(steps) - 0.4)
        ax.set_xticks(at, labels)
        scale = ", logarithmic" if logarithmic else ""
        dressed(ax, "", f"RMSE of {name}{scale}", f"{name}: {first.error[name]:.3g} → {last.error[name]:.3g}")
        ax.grid(False, axis="x")
    legend_below(fig, *axes)
    return fig


def hypothesis(candidate: Candidate) -> str:
    """A candidate's effects and terms, as a label."""
    return "\n".join(
        wrapped(f"{plain(named.effect)} in {named.equation}: {named.term}", 46) for named in candidate.effects
    )


def candidates(verdict: Verdict, most: int = 10) -> Figure:
    """Weights of the plausible hypotheses as bars, with their terms, and how far apart the data can hold them."""
    entries = sorted(verdict.plausible, key=lambda candidate: -candidate.weight)[:most]
    best = ", ".join(plain(named.effect) for named in entries[0].effects) if entries else "nothing"
    close = sum(1 for c in entries[1:] if c.separation is not None and c.separation < SEPARABLE)
    title = f"The data give {best} {100 * entries[0].weight:.0f} % of the weight" if entries else "Nothing is plausible"
    if close:
        title += f"; {close} look-alike{'s' if close > 1 else ''} cannot be told apart from it"
    rows = sum(max(len(candidate.effects), 1) for candidate in entries)
    said = "; ".join(f"{hypothesis(c)}: weight {c.weight:.2f}" for c in entries)
    fig = new_figure(title, f"Weights of the hypotheses that fit. {said}", 1.3 + 0.55 * max(rows, 1))
    ax = fig.subplots()
    at = np.arange(len(entries))
    for k, candidate in enumerate(entries):
        ax.barh(k, candidate.weight, height=0.6, color=BLUE if k == 0 else SKY)
        ax.annotate(
            f"{100 * candidate.weight:.0f} %{_apart(candidate, k)}",
            (candidate.weight, k),
            (5, 0),
            textcoords="offset points",
            va="center",
            fontsize=9.5,
        )
    ax.set_yticks(at, [hypothesis(candidate) for candidate in entries])
    ax.set_ylim(len(entries) - 0.4, -0.6)
    ax.set_xlim(0, 1)
    ax.set_xticks(np.linspace(0, 1, 6), [f"{10 * k} %" for k in range(0, 11, 2)])
    dressed(ax, "share of the weight over all hypotheses that were refitted", "")
    ax.grid(False, axis="y")
    # The note after the longest bar needs room beyond 100 %.
    ax.set_xlim(0, max(1.0, *(c.weight + (0.55 if k else 0.12) for k, c in enumerate(entries)), 1.0))
    return fig


def _apart(candidate: Candidate, rank: int) -> str:
    if candidate.separation is None or rank == 0:
        return ""
    judgement = "cannot be told apart" if candidate.separation < SEPARABLE else "can be told apart"
    return f", separation {candidate.separation:.3g}: {judgement}"
