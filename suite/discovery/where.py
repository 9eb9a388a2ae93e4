"""Where the model fails, in words: "fails for |x2| > 2.6, in every cycle"."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from suite.discovery.result import Discrepancy
from suite.discovery.variable import samples
from suite.model import Model
from suite.record import Record

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

BAND = 1.96  # standard deviations: 95 % of a normal variable
FAR = 4.0  # standard deviations that chance does not reach in any sample
QUANTILES = 40  # thresholds that are tried are this finely spaced over the samples
ENDS = 12  # samples at either end each of which is a threshold too
PURE, WHOLE, CLEAN = 0.8, 0.7, 0.15  # of a region: share that fails in it, of all that fails, and that fails outside
STRONG = 0.5  # of the largest error: where the model fails most of all
BREAK = 2  # samples by which a passage may be interrupted


@dataclass(frozen=True)
class Region:
    """Part of a variable's range, in words, and which samples lie in it."""

    words: str
    inside: Flags
    central: bool = False


def where(found: Discrepancy, record: Record, model: Model) -> str:
    """The sentence: the region of the variable, or of time, in which d leaves its band, and in which passages.

    A region is named where at least 80 % of its samples fail, which are 70 % of all that fail, and at most 15 % of the
    others do. Where there is none, the same is asked of the samples with half of the largest error or more.
    """
    names = list(model.states)
    # Where p' = v is zero, p turns.
    turns = {model.states[name].strip(): name for name in model.definitions}
    j = names.index(found.equation)
    d, sd, label = found.d[:, j], found.d_sd[:, j], f"{found.equation}'"
    if not np.isfinite(sd).all():
        return f"The model error of {label} cannot be estimated: every filter left the finite numbers."
    out = (np.abs(d) > BAND * sd) & (np.abs(d) > 0)
    share = float(out.mean())
    if share < 0.05 and not (out & (np.abs(d) > FAR * sd)).any():
        return f"The smoothed error of {label} stays within its band."
    fails = f"The model fails in {label}"
    if share > 0.9:
        return f"{fails} {_throughout(d[out], record, share)}."
    region = _best(found.variable, samples(model, record, found), out)
    if region is not None:
        turning = _turning(region, turns.get(found.variable))
        return f"{fails} for {region.words}{turning}{_when(found.variable, region, out, record)}."
    region = _best("t", record.t, out) if found.variable != "t" else None
    if region is not None:
        return f"{fails} only for {region.words}{_when('t', region, out, record)}."
    part, span = _stretch(out, record)
    region = _best(found.variable, samples(model, record, found), out, part) if span else None
    if region is not None and (region.inside & ~part).sum() >= 3:
        return f"{fails} for {region.words}, only {span}."
    share_said = f"{fails} in {max(round(100 * share), 1)} % of the samples"
    strong = out & (np.abs(d) > STRONG * np.max(np.abs(d[out])))
    region = _best(found.variable, samples(model, record, found), strong)
    if region is not None:
        return f"{share_said}, most of all for {region.words}."
    return f"{share_said}, in no one range of {found.variable}."


def _throughout(d: Array, record: Record, share: float) -> str:
    whole = "the whole record" if len(record.starts) == 1 else "all of every run"
    said = f"throughout {whole}" if share > 0.98 else f"nearly throughout {whole}"
    return f"{said}, always to the same side" if (d > 0).all() or (d < 0).all() else said


def _regions(name: str, v: Array) -> Iterator[Region]:
    """Everything that could be named: above, below, both outer ends, around zero, and between two thresholds."""
    known = np.sort(v[np.isfinite(v)])
    inner = np.quantile(known, np.linspace(0, 1, QUANTILES + 1))[1:-1]
    # What happens at an end alone may be shorter than a fortieth of the samples.
    levels = np.unique(np.concatenate([known[3:ENDS], inner, known[-ENDS:-3]]))
    for level in levels:
        yield Region(f"{name} > {_number(level)}", v > level)
        yield Region(f"{name} < {_number(level)}", v < level)
    if known.min() < 0 < known.max() and name != "t":
        for level in np.unique(np.quantile(np.abs(known), np.linspace(0, 1, QUANTILES + 1)))[1:-1]:
            # Both sides must be visited, else the sign is needed.
            if (known > level).any() and (known < -level).any():
                yield Region(f"|{name}| > {_number(level)}", np.abs(v) > level)
                yield Region(f"|{name}| < {_number(level)}", np.abs(v) < level, True)
    for i, low in enumerate(inner[::2]):
        for high in inner[::2][i + 1 :]:
            yield Region(f"{name} from {_number(low)} to {_number(high)}", (v > low) & (v < high), low < 0 < high)


def _stretch(out: Flags, record: Record) -> tuple[Flags, str]:
    """The part of a single run outside which nothing fails, and its words; none where that is most of the run."""
    at = np.flatnonzero(out)
    part = np.zeros(len(out), dtype=bool)
    part[at[0] : at[-1] + 1] = True
    if len(record.starts) > 1 or part.mean() > 0.8:
        return part, ""
    before, after = f"before t = {_number(float(record.t[at[-1]]))}", f"after t = {_number(float(record.t[at[0]]))}"
    edge = 0.1 * len(out)
    if at[0] < edge:
        return part, before
    return part, after if at[-1] > len(out) - edge else f"{after.replace('after', 'from')} to {before.split()[-1]}"


def _best(name: str, v: Array, out: Flags, part: Flags | None = None) -> Region | None:
    """The region that agrees best with `out`, if it agrees enough to be named; the simplest among near equals."""
    known = np.isfinite(v)
    part = np.ones(len(v), dtype=bool) if part is None else part
    if not known.any() or np.ptp(v[known]) == 0:
        return None
    top, best = -np.inf, None
    total = int(out.sum())
    for rank, region in enumerate(_regions(name, v)):
        inside = int((region.inside & part).sum())
        hit = int((region.inside & out).sum())
        if inside < 3 or hit < PURE * inside or hit < WHOLE * total or total - hit > CLEAN * (part.sum() - inside):
            continue
        # Agreement as intersection over union; a region with two thresholds must earn the second.
        score = hit / (inside + total - hit) - (0.05 if " from " in region.words else 0.0) - 1e-9 * rank
        if score > top:
            top, best = score, region
    # Both ends are only one region if both fail.
    if best is not None and best.words.startswith("|") and ">" in best.words:
        for side in (v > 0, v < 0):
            half = best.inside & side & part
            if half.any() and (out & half).sum() < 0.5 * half.sum():
                return None
    return best


def _turning(region: Region, position: str | None) -> str:
    return f", at the turning points of {position}" if region.central and position else ""


def _when(name: str, region: Region, out: Flags, record: Record) -> str:
    """In which passages through the region the model fails: ", in every cycle", ", in 7 of 9 passages", ..."""
    inside, failed = [], []
    bounds = record.bounds.tolist()
    for r, (start, end) in enumerate(pairwise(bounds)):
        for a, b in _passages(region.inside[start:end]):
            inside.append(r)
            failed.append(bool(out[start + a : start + b].mean() > 0.5))
    runs = len(bounds) - 1
    if not failed:
        return ""
    if all(failed):
        if runs > 1:
            reached = len(set(inside))
            every = ", in every run" if reached == runs else f", in each of the {reached} runs that reach it"
            return every if reached > 1 else f", which only run {inside[0] + 1} reaches"
        if name == "t" or len(failed) == 1:
            return ""
        return ", both times" if len(failed) == 2 else ", in every cycle"
    return f", in {sum(failed)} of {len(failed)} passages"


def _passages(inside: Flags) -> list[tuple[int, int]]:
    """Stretches of samples in the region, first and one past the last; interruptions of up to two samples do not end
    one, and single samples are none unless nothing else is there.
    """
    at = np.flatnonzero(inside)
    if len(at) == 0:
        return []
    cuts = np.flatnonzero(np.diff(at) > BREAK + 1)
    firsts, lasts = at[np.concatenate([[0], cuts + 1])], at[np.concatenate([cuts, [len(at) - 1]])] + 1
    spans = list(zip(firsts.tolist(), lasts.tolist(), strict=True))
    return [span for span in spans if span[1] - span[0] >= 3] or spans


def _number(value: float) -> str:
    return f"{value:.2g}" if abs(value) < 100 else f"{value:.3g}"
