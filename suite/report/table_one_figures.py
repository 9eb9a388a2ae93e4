"""The sources' Figure 1 from our reconstruction, and the comparison of methods on the same plant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from suite.benchmark.better import MEASURED, Entry
from suite.benchmark.table_one import TRUE_A3, Setting, regress, solve
from suite.report.bench_figures import BLUE, GREEN, GREY, ORANGE, RED, STYLE, canvas, save


def figure_one(folder: Path) -> list[Path]:
    """Model error and states over time, true against estimated by the generalized and conventional estimator."""
    setting = Setting()
    record, truth, generalized = solve(setting, setting.alpha)
    _, _, conventional = solve(setting, 1.0)
    t = record.t
    with mpl.rc_context(STYLE):
        figure = canvas(7.5, 6.0)
        axes = figure.subplots(3, 1, sharex=True)
        rows = (("model error of x1'", truth.d[:, 0]), ("x1", truth.x[:, 0]), ("x2", truth.x[:, 1]))
        for i, (ax, (label, true)) in enumerate(zip(axes, rows, strict=True)):
            ax.plot(t, true, color="black", lw=2.4, alpha=0.35, label="true")
            for estimate, color, dash, name in (
                (generalized, BLUE, "-", f"generalized, alpha = {setting.alpha:g} (a3 = {regress(generalized):.4f})"),
                (conventional, RED, "--", f"conventional, alpha = 1 (a3 = {regress(conventional):.4f})"),
            ):
                assert estimate.d is not None
                ax.plot(t, estimate.d[:, 0] if i == 0 else estimate.x[:, i - 1], dash, color=color, lw=1, label=name)
            ax.set_ylabel(label)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
        axes[2].set_xlabel("time [s]")
        axes[0].set_title(
            f"Model error and states, true against estimated (true a3 = {TRUE_A3}; a reconstruction, one of many)"
        )
        return save(figure, folder / "figure-1")


def comparison(entries: Sequence[Entry], folder: Path) -> list[Path]:
    """a3 by every method against the noise, mean +- sd over seeds, with the Cramer-Rao band."""
    colors = (GREY, "#000000", ORANGE, GREEN, "#56B4E9", "#CC79A7", "#B8A000", BLUE)
    markers = "osD^vP*X"
    methods = [m for m in dict.fromkeys(e.method for e in entries) if not m.startswith("Cramer")]
    noises = list(dict.fromkeys(e.noise for e in entries))
    with mpl.rc_context(STYLE):
        figure = canvas(9.0, 5.0)
        axes = figure.subplots(1, len(MEASURED), sharey=True)
        for ax, measured in zip(axes, MEASURED, strict=True):
            mine = {(e.method, e.noise): e for e in entries if e.measured == measured}
            bound = [mine["Cramer-Rao bound (sd)", noise].values[0] for noise in noises]
            places = np.arange(len(noises), dtype=float)
            band = (TRUE_A3 - np.array(bound), TRUE_A3 + np.array(bound))
            ax.fill_between(places, *band, color="0.88", label="true value +- Cramer-Rao bound")
            ax.axhline(TRUE_A3, color="0.5", lw=0.8)
            for k, method in enumerate(methods):
                shift = 0.08 * (k - (len(methods) - 1) / 2)
                for i, noise in enumerate(noises):
                    values = mine[method, noise].values
                    if values:
                        label = method if i == 0 else None
                        spread = float(np.std(values))
                        style = {"color": colors[k % 8], "marker": markers[k % 8], "ms": 4.5, "lw": 1}
                        ax.errorbar(i + shift, np.mean(values), spread, label=label, **style)
            ax.set_xticks(places, [f"{noise:g}" for noise in noises])
            ax.set_xlabel("noise (sd, absolute)")
            ax.set_title(f"{' and '.join(measured)} measured")
            ax.set_ylim(0.0, 0.025)
        axes[0].set_ylabel("a3, mean and sd over seeds")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=7, frameon=False)
        figure.suptitle("The missing coefficient a3 by method, on the plant of Table 1", fontsize=10)
        return save(figure, folder / "a3-by-method")
