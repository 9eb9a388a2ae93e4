"""Comparing many methods over many cases: mean ranks, Friedman, Nemenyi, performance profiles, the Pareto front.

Arrays of scores are (methods, blocks), lower is better, infinite where a method failed. A block is a case: noise levels
and seeds of one case are no independent witnesses.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.stats import friedmanchisquare, rankdata, studentized_range

from suite.benchmark.statistics import holm, ratios, signed_rank

Array = npt.NDArray[np.float64]
M = TypeVar("M", bound=Hashable)
LEVEL = 0.05


def block_ranks(scores: Array, blocks: Sequence[str]) -> Array:
    """Ranks (methods, distinct blocks) from scores (methods, conditions): ranked under each condition, the ranks
    averaged over the conditions of a block, and ranked again.
    """
    ranks = rankdata(scores, axis=0)
    names = np.array(blocks)
    means = [ranks[:, names == name].mean(axis=1) for name in dict.fromkeys(blocks)]
    return np.asarray(rankdata(np.array(means), axis=1).T, dtype=np.float64)


def friedman(ranks: Array) -> float:
    """P-value of Friedman's test that all methods rank alike (Friedman 1937); 1 below 3 methods or 2 blocks."""
    k, N = ranks.shape
    if k < 3 or N < 2 or np.all(ranks == ranks[:1]):
        return 1.0
    return float(friedmanchisquare(*ranks).pvalue)


def critical_difference(k: int, N: int, level: float = LEVEL) -> float:
    """Mean ranks of k methods over N blocks that differ by more do so significantly (Nemenyi; Demsar 2006, sec. 3.2.2):
    q sqrt(k (k + 1) / (6 N)), q the studentized range over sqrt 2.
    """
    q = float(studentized_range.ppf(1.0 - level, k, np.inf)) / np.sqrt(2.0)
    return float(q * np.sqrt(k * (k + 1) / (6.0 * N)))


def cliques(means: Sequence[float], difference: float) -> list[tuple[int, int]]:
    """The largest groups (first, last) of rising mean ranks that do not differ significantly; none of one."""
    found: list[tuple[int, int]] = []
    for first, mean in enumerate(means):
        last = max(i for i, other in enumerate(means) if other - mean <= difference)
        if last > first and (not found or last > found[-1][1]):
            found.append((first, last))
    return found


def profile(scores: Array, factors: Array) -> Array:
    """Share of blocks on which each method is within each factor of the best one, (methods, factors).

    The performance profile rho_s(tau) of Dolan and More (2002); a block on which all fail counts for none.
    """
    best = scores.min(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(scores == best, 1.0, scores / best)
    ratio = np.where(np.isfinite(scores), ratio, np.inf)
    return np.asarray((ratio[:, :, None] <= factors).mean(axis=1), dtype=np.float64)


def not_beaten(scores: Mapping[M, Mapping[int, float]]) -> tuple[M | None, set[M], bool]:
    """Of methods with their scores by seed: the best by median, those it does not beat significantly (Wilcoxon's
    signed-rank test over common seeds, Holm over the methods, 5 %), and whether so few seeds could show it at all.

    A method on too few seeds to be tested is neither the best, where others have enough, nor equal to it, unless it is
    at least as good on the seeds that they share.
    """
    medians = {name: float(np.median(list(table.values()))) for name, table in scores.items() if table}
    alive = {name for name, middle in medians.items() if np.isfinite(middle)}
    if not alive:
        return None, set(), False
    count = len(medians) - 1
    # The smallest p-value of n pairs is 2 / 2^n.
    able = {name for name in alive if count and 2.0 ** (1 - len(scores[name])) * count <= LEVEL}
    best = min(able or alive, key=lambda name: medians[name])
    others = [name for name in medians if name != best]
    p = holm([signed_rank(scores[name], scores[best]) for name in others])
    equal = {name for name, value in zip(others, p, strict=True) if value > LEVEL}
    if able:
        worse = {name for name in equal - able if not np.median(ratios(scores[name], scores[best])) <= 1.0}
        equal -= worse
    return best, {best} | equal & alive, bool(able)


def front(points: Mapping[M, tuple[float, float]]) -> list[M]:
    """The points (cost, error) than which none is both cheaper and better, cheapest first; infinite ones left out."""
    kept: list[M] = []
    best = np.inf
    for name, (_, error) in sorted(points.items(), key=lambda item: item[1]):
        if np.isfinite(points[name][0]) and error < best:
            best = error
            kept.append(name)
    return kept
