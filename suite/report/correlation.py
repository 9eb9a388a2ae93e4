"""Figures of whether the residual is white and unrelated to the inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from suite.discovery.misfit import residual
from suite.discovery.result import Comparison
from suite.discovery.whiteness import Cross, band, cross_correlation
from suite.model import Model
from suite.record import Record
from suite.report.canvas import BLUE, GREEN, INK, VERMILION, Array, dressed, legend_below, new_figure

PANELS = 6
CHANCE = 0.03  # share of lags outside a 99 % band from which it is no longer chance


def autocorrelation(model: Model, record: Record, correlation: Mapping[str, Array]) -> Figure:
    """Autocorrelation of the residual from lag 1, one panel an output, with the 99 % band of white noise."""
    names = list(model.outputs)
    bands = {name: band(record, names.index(name)) for name in correlation}
    beyond = {name: int((np.abs(r) > bands[name]).sum()) for name, r in correlation.items()}
    coloured = [name for name, r in correlation.items() if beyond[name] > max(1, CHANCE * len(r))]
    title = (
        f"The residual of {_listed(coloured)} repeats itself: something regular is left in it"
        if coloured
        else "The residual is white: nothing regular is left in it"
    )
    said = "; ".join(f"{name}: {beyond[name]} of {len(r)} lags outside" for name, r in correlation.items())
    fig = new_figure(title, f"Autocorrelation of the residuals with 99 % bands. {said}", 0.9 + 1.9 * len(correlation))
    axes = fig.subplots(max(len(correlation), 1), 1, squeeze=False)[:, 0]
    for ax, (name, r) in zip(axes, correlation.items(), strict=False):
        _stems(ax, np.arange(1, len(r) + 1, dtype=np.float64), r, bands[name], "white noise, 99 %")
        said = f"{name}: {beyond[name]} of {len(r)} lags outside the band"
        dressed(ax, "lag (samples)" if ax is axes[-1] else "", "autocorrelation", said)
    legend_below(fig, *axes)
    return fig


def cross(model: Model, record: Record, comparison: Comparison) -> Figure | None:
    """Each input against the residual of each output at lags -20..20, with 99 % bands; None without inputs.

    Of many pairs the six that leave their band furthest are drawn.
    """
    e = residual(model, record, comparison.Y, comparison.sigma)
    found = cross_correlation(record, e, list(model.outputs), list(model.inputs))
    pairs = [(output, name, entry) for output, own in found.items() for name, entry in own.items()]
    if not pairs:
        return None
    pairs = sorted(pairs, key=lambda pair: -float(np.max(np.abs(pair[2].r)) / pair[2].band))[:PANELS]
    told = [f"{name} in {output}" for output, name, entry in pairs if _related(entry)]
    title = (
        f"The residual still follows {_listed(told)}: part of the response to it is not in the model"
        if told
        else "The residual is unrelated to the inputs"
    )
    said = "; ".join(f"{name} and {output}: {_outside(entry)} of {len(entry.r)} lags" for output, name, entry in pairs)
    fig = new_figure(title, f"Input and residual at lags, 99 % bands; outside: {said}", 0.9 + 1.9 * len(pairs))
    axes = fig.subplots(len(pairs), 1, squeeze=False)[:, 0]
    for ax, (output, name, entry) in zip(axes, pairs, strict=True):
        _stems(ax, entry.lags.astype(np.float64), entry.r, entry.band, "unrelated, 99 %")
        ax.axvline(0, color=INK, linewidth=0.6)
        said = f"input {name}, residual of {output}: {_outside(entry)} of {len(entry.r)} lags outside the band"
        xlabel = "lag (samples; to the right the input came first)" if ax is axes[-1] else ""
        dressed(ax, xlabel, "correlation", said)
    legend_below(fig, *axes)
    return fig


def _outside(entry: Cross) -> int:
    return int((np.abs(entry.r) > entry.band).sum())


def _related(entry: Cross) -> bool:
    return _outside(entry) > max(1, CHANCE * len(entry.r))


def _listed(names: list[str]) -> str:
    return " and ".join(names) if len(names) <= 2 else f"{', '.join(names[:-1])} and {names[-1]}"


def _stems(ax: Axes, lags: Array, r: Array, band: float, label: str) -> None:
    outside = np.abs(r) > band
    ax.axhspan(-band, band, color=GREEN, alpha=0.25, linewidth=0, label=label)
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.bar(lags[~outside], r[~outside], width=0.5, color=BLUE, label="inside the band")
    if outside.any():
        ax.bar(lags[outside], r[outside], width=0.5, color=VERMILION, label="outside the band")
    ax.margins(x=0.02)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    reach = max(1.3 * band, 1.1 * float(np.max(np.abs(r), initial=0.0)))
    ax.set_ylim(-reach, reach)
