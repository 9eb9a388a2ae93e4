"""Long records: the search runs where the model fails most, and the finalists are fitted to all of the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Point, Problem
from suite.discovery.fit import LEVELS, Hypothesis, homotopy
from suite.discovery.identify import WORTH, Search, left, search
from suite.discovery.starts import brought

Array = npt.NDArray[np.float64]

LONG = 8192  # samples from which a record is searched in a block of it
BLOCK = 2000  # samples of that block
FINALISTS = 2  # effects that are fitted to the whole record, and the best combination where it is worth it


def search_long(problem: Problem) -> Search:
    """The search on one block, its best hypotheses fitted to the whole record; `block` keeps the search itself."""
    base = homotopy(problem, problem.start)
    small = _block(problem, base)
    found = search(small)
    singles = sorted((h for h in found.fitted if len(h.active) == 1), key=found.criterion)[:FINALISTS]
    best = min(found.fitted, key=found.criterion, default=None)
    finalists = list(singles)
    if best is not None and len(best.active) > 1 and left(best) < WORTH * min(map(left, singles)):
        finalists.append(best)
    fitted = [_whole(problem, base, h) for h in finalists]
    return Search(problem, base, tuple(fitted), found.absorbed, found.frequencies, found.scores, block=found)


def _block(problem: Problem, base: Hypothesis) -> Problem:
    """The problem on the part of a run where the base model's error is largest; its first state is free."""
    record = problem.record
    level = base.exact if base.exact.passed.finite else base.best
    square = np.zeros(problem.seen.shape)
    square[problem.seen] = level.passed.e**2
    each = square.sum(axis=1)
    best, at = -1.0, (0, min(BLOCK, len(record)))
    for first, last in zip(record.bounds[:-1], record.bounds[1:], strict=True):
        for start in range(int(first), max(int(last) - BLOCK, int(first)) + 1, BLOCK // 2):
            end = min(start + BLOCK, int(last))
            if each[start:end].mean() > best and end - start > BLOCK // 4:
                best, at = float(each[start:end].mean()), (start, end)
    start, end = at
    x0 = np.zeros((1, problem.start.x0.shape[1]))
    x0[0, : len(problem.model.states)] = base.best.passed.X[start, : len(problem.model.states)]
    part = replace(record.part(start, end), names=())
    small = problem.on(
        part, Point(x0, problem.start.p), path=problem.path[start:end], free_x0=np.ones_like(problem.free_x0)
    )
    point = small.start
    for k in range(len(problem.terms)):
        point = brought(small, point, k)
    # Inner scales keep the units of the whole record, so that the finalists mean the same on both.
    small.__dict__["reach"] = problem.reach
    small.__dict__["limits"] = problem.limits
    return small.on(part, point, R=problem.R)


def _whole(problem: Problem, base: Hypothesis, hypothesis: Hypothesis) -> Hypothesis:
    """A hypothesis of the block, fitted to the whole record from what it found there."""
    point = Point(base.exact.point.x0 if base.exact.passed.finite else base.best.point.x0, hypothesis.exact.point.p)
    for k in hypothesis.active:
        point = brought(problem, point, k)
    return homotopy(problem, point, hypothesis.active, first=LEVELS[-2], tolerance=1.0)
