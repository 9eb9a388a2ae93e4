"""Figures of the recovery benchmark, drawn from stored rows alone: nothing is run again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

from suite.benchmark.conditions import SPOILED
from suite.benchmark.recovery import OURS
from suite.benchmark.recovery_summary import SEPARABLE, by_method, certain, wrong
from suite.benchmark.statistics import wilson
from suite.report.canvas import BLUE, GREEN, GREY, INK, ORANGE, SKY, VERMILION, dressed, legend_below, new_figure

Row = Mapping[str, Any]

WEIGHTS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.99, 1.0)
DISTANCES = (0.1, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 1e4, 1e13)
MARKS = ("o", "s", "^")
PALETTE = (BLUE, ORANGE, GREEN, VERMILION, SKY, GREY)


def drawn(rows: Sequence[Row]) -> dict[str, Figure]:
    """Every figure for which there are rows, by the name of its file."""
    figures = {
        "reliability": _reliability(rows), "coefficients": _coefficients(rows), "success": _success(rows),
        "methods": _methods(rows),
    }  # fmt: skip
    return {name: figure for name, figure in figures.items() if figure is not None}


def _reliability(rows: Sequence[Row]) -> Figure | None:
    """How often a hypothesis of a stated weight is the truth."""
    plain: list[tuple[float, bool]] = []
    hard: list[tuple[float, bool]] = []
    for row in (row for row in rows if row["estimator"] == OURS and row.get("plausible_weights")):
        for name, weight in zip(row["plausible"], row["plausible_weights"], strict=True):
            # A look-alike that is named first counts as the truth.
            alike = name == row.get("named") and not wrong(row)
            hit = bool(row.get("missing")) and (name == row["missing"] or alike)
            (hard if row["variant"] in SPOILED else plain).append((float(weight), hit))
    if not plain and not hard:
        return None
    named = [row for row in rows if row["estimator"] == OURS and row["variant"] not in SPOILED and certain(row)]
    bad = sum(map(wrong, named))
    title = f"Of {len(named)} verdicts with a weight above 0.9, {bad} {'was' if bad == 1 else 'were'} wrong"
    if not named:
        title = "How often a hypothesis of a stated weight is the truth"
    figure = new_figure(title, "Share of hypotheses that are true against their stated weight, in bins.", 4.9)
    ax = dressed(figure.subplots(), "stated weight of a hypothesis", "share that is true")
    ax.plot([0, 1], [0, 1], color=GREY, lw=1.2, ls="--", label="honest: as often as stated")
    groups = ((plain, BLUE, "o", "white noise"), (hard, VERMILION, "s", "spoiled data"))
    for k, (pairs, color, mark, label) in enumerate(groups):
        _binned(ax, pairs, WEIGHTS, color, mark, label, shift=0.008 * k, below=k)
    ax.set_xlim(-0.02, 1.04)
    ax.set_ylim(-0.12, 1.06)
    legend_below(figure, ax)
    return figure


def _binned(
    ax: Axes, pairs: Sequence[tuple[float, bool]], edges: Sequence[float], color: str, mark: str, label: str,
    shift: float = 0.0, below: int = 0, middle: bool = False,
) -> None:  # fmt: skip
    """The share of hits in each bin with its Wilson interval, and its count written along the bottom."""
    for k, (low, high) in enumerate(pairwise(edges)):
        last = k == len(edges) - 2
        inside = [(x, hit) for x, hit in pairs if low <= x < high or (last and x == high)]
        if not inside:
            continue
        share, down, up = wilson(sum(hit for _, hit in inside), len(inside))
        at = (float(k) if middle else float(np.mean([x for x, _ in inside]))) + shift
        ax.errorbar(
            at, share, [[max(share - down, 0)], [max(up - share, 0)]], fmt=mark, color=color, ms=6, capsize=3, lw=1.4,
            label=label,
        )  # fmt: skip
        y = -0.05 - 0.045 * below
        ax.text(at, y, str(len(inside)), ha="center", va="center", fontsize=8, color=color)


def _coefficients(rows: Sequence[Row]) -> Figure | None:
    """Errors of the coefficients over their stated deviation, against the normal."""
    plain = [row for row in rows if row["estimator"] == OURS and row["variant"] == "missing"]
    z = np.array([value for row in plain for value in (row.get("z") or {}).values()])
    if len(z) == 0:
        return None
    rms = float(np.sqrt(np.mean(z**2)))
    cover = float(np.mean(np.abs(z) < 1.96))
    title = f"Coefficients err by {rms:.2f} of their stated deviation; {100 * cover:.0f} % of the 95 % intervals cover"
    figure = new_figure(title, "Histogram of coefficient errors over stated standard deviations.", 4.2)
    ax = dressed(figure.subplots(), "(coefficient - true value) / stated standard deviation", "density")
    edges = np.linspace(-4.5, 4.5, 37 if len(z) > 300 else 19)
    ax.hist(
        np.clip(z, -4.49, 4.49), bins=edges.tolist(), density=True, color=SKY, label=f"{len(z)} coefficients", zorder=2
    )
    grid = np.linspace(-4.5, 4.5, 200)
    ax.plot(grid, norm.pdf(grid), color=INK, lw=1.6, zorder=3, label="normal distribution, as stated")
    for side in (-1.96, 1.96):
        ax.axvline(side, color=VERMILION, lw=1.2, ls="--", label="95 % interval")
    beyond = int((np.abs(z) > 4.5).sum())
    if beyond:
        ax.text(0.99, 0.97, f"{beyond} beyond, drawn at the edge", transform=ax.transAxes, ha="right", va="top")
    legend_below(figure, ax)
    return figure


def _success(rows: Sequence[Row]) -> Figure | None:
    """How often the truth is named, against how far its nearest rival is."""
    plain = [
        row for row in rows
        if row["estimator"] == OURS and row["variant"] == "missing" and row.get("delta2_merged") is not None
    ]  # fmt: skip
    if not plain:
        return None
    far = [row for row in plain if row["delta2_merged"] >= SEPARABLE]
    share = 100.0 * sum(bool(row["exact_merged"]) for row in far) / len(far) if far else 0.0
    title = f"Where the nearest rival is at least 16 away, {share:.0f} % of {len(far)} records name it exactly"
    if not far:
        title = "In none of these records is the truth 16 away from its nearest rival"
    figure = new_figure(title, "Share of records in which the truth is named, against delta squared.", 4.7)
    ax = dressed(figure.subplots(), "delta^2: squared distance of the nearest rival, in noise units", "share")
    places = dict(zip(DISTANCES[:-1], range(len(DISTANCES) - 1), strict=True))
    for k, (key, color, mark, label) in enumerate((
        ("exact_merged", BLUE, "o", "named exactly"), ("in_plausible_merged", ORANGE, "s", "in the plausible set"),
    )):  # fmt: skip
        pairs = [(max(row["delta2_merged"], DISTANCES[0]), bool(row[key])) for row in plain]
        _binned(ax, pairs, DISTANCES, color, mark, label, shift=0.2 * k - 0.1, below=k, middle=True)
    ax.axvline(places[SEPARABLE] - 0.5, color=GREY, lw=1.2, ls="--", label="16: enough to tell")
    names = ["below 1", *(f"{a:g} to {b:g}" for a, b in pairwise(DISTANCES[1:-1])), "10000 on"]
    ax.set_xticks(range(len(names)), names, fontsize=8.5)
    ax.set_xlim(-0.6, len(names) - 0.4)
    ax.set_ylim(-0.14, 1.06)
    legend_below(figure, ax)
    return figure


def _methods(rows: Sequence[Row]) -> Figure | None:
    """Every method on the same records, by noise: the effect first, and the exact structure."""
    lines = [line for line in by_method(rows) if line["records"]]
    if not lines:
        return None
    methods = list(dict.fromkeys(line["method"] for line in lines))
    noises = sorted({line["noise"] for line in lines})
    lowest = [line for line in lines if line["noise"] == noises[0] and line["method"] != OURS]
    title = "How often each method names what is missing"
    if lowest:
        best = max(lowest, key=lambda line: line["exact"])
        ours = (
            "" if best["ours_exact"] is None else f", {OURS} in {100 * best['ours_exact']:.0f} % of {best['records']}"
        )
        title = (
            f"At {100 * noises[0]:g} % noise {best['method']} finds exactly what is missing in "
            f"{100 * best['exact']:.0f} % of the records{ours}"
        )
    if lowest and not best["exact"]:
        title = f"At {100 * noises[0]:g} % noise no rival finds exactly what is missing{ours}"
    figure = new_figure(title, "Bars by method and noise: effect first, exact structure.", 1.5 + 0.85 * len(methods))
    axes = figure.subplots(1, 2, sharey=True)
    height = 0.8 / len(noises)
    for ax, key, label in zip(axes, ("first", "exact"), ("true effect first", "exact structure"), strict=True):
        dressed(ax, "share of records", "", label)
        for k, noise in enumerate(noises):
            for line in (line for line in lines if line["noise"] == noise):
                at = methods.index(line["method"]) - 0.4 + height * (k + 0.5)
                low, high = line[key] - line[f"{key}_low"], line[f"{key}_high"] - line[key]
                ax.barh(
                    at, line[key], 0.92 * height, color=PALETTE[k % len(PALETTE)], label=f"noise {100 * noise:g} %",
                    xerr=[[max(low, 0)], [max(high, 0)]], error_kw={"ecolor": INK, "elinewidth": 1, "capsize": 2},
                )  # fmt: skip
        ax.set_xlim(0, 1.02)
        ax.grid(False, axis="y")
    axes[0].set_yticks(range(len(methods)), methods, fontsize=9.5)
    axes[0].invert_yaxis()
    legend_below(figure, axes[0])
    return figure
