"""Statistics over seeds: the same seeds for all, so differences are paired; failures rank last and are counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import norm, rankdata, wilcoxon

Array = npt.NDArray[np.float64]
RESAMPLES = 2000


def is_reference(row: Mapping[str, Any]) -> bool:
    """Whether a row says what is possible or what costs nothing: shown beside the methods, never ranked among them."""
    return "reference" in (row.get("kind"), row.get("variant"))


def interval(values: Array, level: float = 0.95) -> tuple[float, float, float]:
    """Median and its bootstrap percentile interval; values that are not finite count as infinitely bad."""
    values = np.sort(np.where(np.isnan(values), np.inf, values))
    lower, upper = _middles(len(values))
    medians = np.sort((values[lower] + values[upper]) / 2)
    low, high = (medians[round(share * (RESAMPLES - 1))] for share in ((1 - level) / 2, (1 + level) / 2))
    return float(np.median(values)), float(low), float(high)


@cache
def _middles(count: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Where the two middle values of each resample stand among `count` sorted values: its median needs no more."""
    picks = np.sort(np.random.default_rng(0).integers(0, count, (RESAMPLES, count)), axis=1)
    return picks[:, (count - 1) // 2].copy(), picks[:, count // 2].copy()


def wilson(hits: int, count: int, level: float = 0.95) -> tuple[float, float, float]:
    """A share and its interval (Wilson 1927), which holds at 0 and at 1 too; NaN, 0, 1 where nothing was counted."""
    if count == 0:
        return float("nan"), 0.0, 1.0
    z = float(norm.ppf(0.5 + level / 2))
    share, weight = hits / count, 1.0 / (1.0 + z * z / count)
    middle = weight * (share + z * z / (2 * count))
    half = weight * z * np.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    return share, float(max(middle - half, 0.0)), float(min(middle + half, 1.0))


def resampled(values: Array, figure: Callable[[Array], Any], level: float = 0.95) -> tuple[float, float, float]:
    """A figure of values (figure(table, over the last axis)) and its bootstrap percentile interval."""
    if len(values) == 0:
        return float("nan"), float("nan"), float("nan")
    picks = np.random.default_rng(0).integers(0, len(values), (RESAMPLES, len(values)))
    low, high = np.quantile(figure(values[picks]), [(1 - level) / 2, (1 + level) / 2])
    return float(figure(values)), float(low), float(high)


def ratios(mine: Mapping[int, float], reference: Mapping[int, float]) -> Array:
    """mine / reference on each common seed on which the reference gave a number; infinite where mine failed."""
    return np.array([mine[seed] / reference[seed] for seed in mine if 0 < reference.get(seed, np.inf) < np.inf])


def paired_ratio(mine: Mapping[int, float], reference: Mapping[int, float]) -> tuple[float, float, float] | None:
    """Median of the ratios over common seeds, with its bootstrap interval; None where the reference gave no number."""
    found = ratios(mine, reference)
    return interval(found) if len(found) else None


def holm(p: Sequence[float]) -> list[float]:
    """P-values adjusted for their number (Holm 1979)."""
    order = np.argsort(p)
    adjusted, floor = [0.0] * len(p), 0.0
    for rank, i in enumerate(order):
        floor = max(floor, min(1.0, (len(p) - rank) * p[i]))
        adjusted[i] = floor
    return adjusted


def signed_rank(mine: Mapping[int, float], reference: Mapping[int, float]) -> float:
    """P-value of Wilcoxon's signed-rank test on log ratios of common seeds; 1 where there is nothing to compare.

    A failure is a difference above all others, so that it counts against who failed.
    """
    a, b = (np.array([table[s] for s in mine if s in reference], dtype=np.float64) for table in (mine, reference))
    with np.errstate(divide="ignore", invalid="ignore"):
        gaps = np.log(a) - np.log(b)
    gaps[np.isnan(gaps)] = 0.0  # both failed, or both are exact
    beyond = 1.0 + float(np.abs(gaps[np.isfinite(gaps)]).max(initial=0.0))
    gaps = np.clip(gaps, -beyond, beyond)
    return float(wilcoxon(gaps).pvalue) if len(gaps) > 4 and np.any(gaps != 0) else 1.0


def ranks(scores: Mapping[str, Mapping[Any, float]]) -> dict[str, float]:
    """Mean rank of each method over blocks (a block: one case, condition and seed); no score ranks last."""
    blocks = sorted({block for table in scores.values() for block in table}, key=str)
    grid = np.array([[table.get(block, np.nan) for block in blocks] for table in scores.values()])
    grid = np.where(np.isfinite(grid), grid, np.inf)
    return dict(zip(scores, rankdata(grid, axis=0).mean(axis=1).tolist(), strict=True))


def score(row: Mapping[str, Any], metric: str) -> float:
    """A row's metric; infinite where the cell did not end well or has none."""
    value = row.get(metric)
    return float(value) if row["status"] == "ok" and value is not None else float("inf")


def summarise(
    rows: Iterable[Mapping[str, Any]], metrics: Sequence[str], reference: str = "ekf"
) -> list[dict[str, Any]]:
    """One line a case, noise, estimator and variant, best state error first.

    Counts by status; of each metric the median and its interval over seeds (failures infinite); the paired ratio of the
    state error to the untuned reference with its interval and Holm's p-value.
    """
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["case"], row["noise"], row["estimator"], row["variant"]), []).append(row)
    lines: list[dict[str, Any]] = []
    for (case, noise, estimator, variant), group in groups.items():
        line: dict[str, Any] = {"case": case, "noise": noise, "estimator": estimator, "variant": variant}
        line |= {"seeds": len(group), "ok": sum(row["status"] == "ok" for row in group)}
        line["reason"] = next((row["reason"] for row in group if row["reason"]), "")
        for metric in metrics:
            if any(row.get(metric) is not None for row in group):
                middle, low, high = interval(np.array([score(row, metric) for row in group]))
                line |= {metric: middle, f"{metric}_low": low, f"{metric}_high": high}
        mine = {row["seed"]: score(row, "state_nrmse") for row in group}
        base = {row["seed"]: score(row, "state_nrmse") for row in groups.get((case, noise, reference, "default"), [])}
        ratio = paired_ratio(mine, base)
        if ratio is not None:
            line |= dict(zip(("ratio", "ratio_low", "ratio_high"), ratio, strict=True))
            line["p"] = signed_rank(mine, base)
        lines.append(line)
    tested = [line for line in lines if "p" in line]
    for line, p in zip(tested, holm([line["p"] for line in tested]), strict=True):
        line["p"] = p
    return sorted(lines, key=lambda line: (line["case"], line["noise"], line.get("state_nrmse", np.inf)))
