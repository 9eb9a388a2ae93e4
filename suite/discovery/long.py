"""Long records: the search runs where the model fails most, and the finalists are fitted to all of the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Problem
from suite.discovery.fit import LEVELS, RISEN, Hypothesis, homotopy
from suite.discovery.frame import Point
from suite.discovery.identify import WORTH, Search, left, search
from suite.discovery.patchwork import hollow, patched
from suite.discovery.starts import brought

Array = npt.NDArray[np.float64]

LONG = 4096  # samples from which a record is searched in a block of it
BLOCK = 2000  # samples of that block
FEWEST = 10  # samples of a run in it
WORSE = 4.0  # times the block's mean squared error: what a fit of the whole record has lost its way at
FINALISTS = 2  # effects that are fitted to the whole record, and the best combination where it is worth it


def search_long(problem: Problem) -> Search:
    """The search on one block, its best hypotheses fitted to the whole record; `block` keeps the search itself."""
    base = homotopy(problem, problem.start)
    small = _block(problem, base)
    found = search(small)
    said = [h for h in found.fitted if not (patched(small, h) or hollow(small, h))]
    singles = sorted((h for h in said if len(h.active) == 1), key=found.criterion)[:FINALISTS]
    best = min(said, key=found.criterion, default=None)
    finalists = list(singles)
    if best is not None and len(best.active) > 1 and left(best) < WORTH * min(map(left, singles), default=np.inf):
        finalists.append(best)
    fitted = [_whole(problem, base, h) for h in finalists]
    return Search(problem, base, tuple(fitted), found.absorbed, found.frequencies, found.scores, block=found)


def _block(problem: Problem, base: Hypothesis) -> Problem:
    """The problem on the part of the record where the base model's error is largest; its first states are free."""
    record, n = problem.record, len(problem.model.states)
    level = base.exact if base.exact.passed.finite else base.best
    square = np.zeros(problem.seen.shape)
    square[problem.seen] = level.passed.e**2
    each = square.sum(axis=1)
    first = max(range(0, len(record) - BLOCK + 1, BLOCK // 2), key=lambda at: float(each[at : at + BLOCK].mean()))
    last = first + BLOCK
    # A run that ends or begins at the edge with a sample or two is left out.
    inner = [s for s in record.starts if first < s < last]
    first = next((s for s in inner if s - first < FEWEST), first)
    last = next((s for s in inner if last - s < FEWEST), last)
    starts = [first, *(s for s in inner if first < s < last)]
    part = replace(
        record, t=record.t[first:last], u=record.u[first:last], y=record.y[first:last],
        starts=tuple(s - first for s in starts), names=(), whole=None,
    )  # fmt: skip
    x0 = np.zeros((len(starts), problem.start.x0.shape[1]))
    x0[:, :n] = base.best.passed.X[starts, :n]
    start = Point(x0, problem.start.p)
    small = problem.on(part, start, path=problem.path[first:last], free_x0=np.ones_like(problem.free_x0))
    for k in range(len(problem.terms)):
        start = brought(small, start, k)
    small = small.on(part, start)
    # Inner scales keep the units of the whole record, so that the finalists mean the same on both.
    small.__dict__["reach"] = problem.reach
    small.__dict__["limits"] = problem.limits
    return small


def _whole(problem: Problem, base: Hypothesis, hypothesis: Hypothesis) -> Hypothesis:
    """A hypothesis of the block, fitted to the whole record from what it found there.

    Where the base model's exact fit ended far from the data, as that of a chaotic plant does, its first states lead
    nowhere: then from the states of its most likely level, and over all levels below that.
    """
    exact = base.exact if base.exact.passed.finite else base.best
    fitted = _from(problem, exact.point.x0, hypothesis, LEVELS[-2], RISEN)
    if left(fitted) > WORSE * left(hypothesis) and exact is not base.best:
        # The block has shown what it is worth: no rise on the way ends the walk.
        again = _from(problem, base.best.point.x0, hypothesis, base.best.q, np.inf)
        fitted = min(fitted, again, key=left)
    return fitted


def _from(problem: Problem, x0: Array, hypothesis: Hypothesis, first: float, risen: float) -> Hypothesis:
    point = Point(x0, hypothesis.exact.point.p)
    for k in hypothesis.active:
        point = brought(problem, point, k)
    return homotopy(problem, point, hypothesis.active, first=first, tolerance=1.0, risen=risen)
