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
    middle, low, high = intervals(np.asarray(values)[None, :], level)[0]
    return float(middle), float(low), float(high)


def intervals(table: Array, level: float = 0.95) -> Array:
    """`interval` of each row of a table (rows, values), as (rows, 3)."""
    values = np.sort(np.where(np.isnan(table), np.inf, table), axis=1)
    lower, upper, often = _middles(values.shape[1])
    medians = (values[:, lower] + values[:, upper]) / 2
    order = np.argsort(medians, axis=1)
    passed = np.cumsum(often[order], axis=1)
    rows, found = np.arange(len(values)), [np.median(values, axis=1)]
    for share in ((1 - level) / 2, (1 + level) / 2):
        place = np.argmax(passed > round(share * (RESAMPLES - 1)), axis=1)
        found.append(medians[rows, order[rows, place]])
    return np.stack(found, axis=1)


@cache
def _middles(count: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Where the two middle values of a resample stand among `count` sorted values, and how many resamples have them
    there: a median needs no more.
    """
    picks = np.sort(np.random.default_rng(0).integers(0, count, (RESAMPLES, count)), axis=1)
    pairs, often = np.unique(picks[:, [(count - 1) // 2, count // 2]], axis=0, return_counts=True)
    return pairs[:, 0].copy(), pairs[:, 1].copy(), often


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
    return signed_ranks([(mine, reference)])[0]


def signed_ranks(pairs: Sequence[tuple[Mapping[int, float], Mapping[int, float]]]) -> list[float]:
    """`signed_rank` of each pair."""
    found = [1.0] * len(pairs)
    alike: dict[int, list[tuple[int, Array]]] = {}
    for i, (mine, reference) in enumerate(pairs):
        gaps = _gaps(mine, reference)
        if len(gaps) <= 4 or not np.any(gaps != 0):
            continue
        if len(np.unique(np.abs(gaps))) == len(gaps) and np.all(gaps != 0):
            alike.setdefault(len(gaps), []).append((i, gaps))
        else:
            # How scipy takes ties and zeros depends on the sample, so each is tested alone, and once: failures tie.
            found[i] = _tied(tuple(np.sort(np.sign(gaps) * rankdata(np.abs(gaps))).tolist()))
    for entries in alike.values():
        p = np.atleast_1d(wilcoxon(np.array([gaps for _, gaps in entries]), axis=1).pvalue)
        for (i, _), value in zip(entries, p.tolist(), strict=True):
            found[i] = value
    return found


@cache
def _tied(ranks: tuple[float, ...]) -> float:
    """The p-value of signed ranks; those of 0 are differences of zero."""
    return float(wilcoxon(np.array(ranks)).pvalue)


def _gaps(mine: Mapping[int, float], reference: Mapping[int, float]) -> Array:
    """Differences of the logarithms on common seeds; those of failures lie beyond all others."""
    a, b = (np.array([table[s] for s in mine if s in reference], dtype=np.float64) for table in (mine, reference))
    with np.errstate(divide="ignore", invalid="ignore"):
        gaps = np.log(a) - np.log(b)
    gaps[np.isnan(gaps)] = 0.0  # both failed, or both are exact
    beyond = 1.0 + float(np.abs(gaps[np.isfinite(gaps)]).max(initial=0.0))
    kept: Array = np.clip(gaps, -beyond, beyond)
    return kept


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
    # What is computed for many lines at once: where it belongs and its values.
    spreads: list[tuple[dict[str, Any], str, Array]] = []
    tested: list[tuple[dict[str, Any], dict[int, float], dict[int, float]]] = []
    for (case, noise, estimator, variant), group in groups.items():
        line: dict[str, Any] = {"case": case, "noise": noise, "estimator": estimator, "variant": variant}
        line |= {"seeds": len(group), "ok": sum(row["status"] == "ok" for row in group)}
        line["reason"] = next((row["reason"] for row in group if row["reason"]), "")
        for metric in metrics:
            if any(row.get(metric) is not None for row in group):
                line |= dict.fromkeys((metric, f"{metric}_low", f"{metric}_high"))
                spreads.append((line, metric, np.array([score(row, metric) for row in group])))
        mine = {row["seed"]: score(row, "state_nrmse") for row in group}
        base = {row["seed"]: score(row, "state_nrmse") for row in groups.get((case, noise, reference, "default"), [])}
        found = ratios(mine, base)
        if len(found):
            line |= dict.fromkeys(("ratio", "ratio_low", "ratio_high"))
            spreads.append((line, "ratio", found))
            tested.append((line, mine, base))
        lines.append(line)
    for count in {len(values) for _, _, values in spreads}:
        alike = [entry for entry in spreads if len(entry[2]) == count]
        for (line, name, _), spread in zip(alike, intervals(np.array([v for _, _, v in alike])).tolist(), strict=True):
            line |= dict(zip((name, f"{name}_low", f"{name}_high"), spread, strict=True))
    p = holm(signed_ranks([(mine, base) for _, mine, base in tested]))
    for (line, _, _), adjusted in zip(tested, p, strict=True):
        line["p"] = adjusted
    return sorted(lines, key=lambda line: (line["case"], line["noise"], line.get("state_nrmse", np.inf)))
