"""A model over the whole of a very long record: simulated in chunks that carry the state on, and only sums are kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from suite.discovery.engine import Problem
from suite.discovery.fit import homotopy
from suite.discovery.frame import Layout, Point
from suite.discovery.noise import without_spikes
from suite.discovery.starts import brought, first_states
from suite.record import Record

Array = npt.NDArray[np.float64]
Bounds = npt.NDArray[np.int64]

PIECE = 4096  # samples of a piece; the first of them tell a run's first state
CHUNK = 65_536  # samples of a chunk
NUMBERS = 1 << 22  # of the largest array of a chunk, which is that many bytes eight times


@dataclass(frozen=True)
class Survey:
    """One simulation over all samples. `error` (outputs,) root mean square; `first`, `last` (pieces,) samples of each
    piece of a run, the last one past it; `square` (pieces,) mean squared error in noise units, NaN where nothing was
    measured, `count` (pieces,) the measurements; `finite`: whether the simulation stayed so.
    """

    error: Array
    first: Bounds
    last: Bounds
    square: Array
    count: Bounds
    finite: bool


def pieces(record: Record, length: int = PIECE) -> tuple[Bounds, Bounds]:
    """First samples of a record's pieces, and one past their last: of `length` samples, a short rest joins the last."""
    firsts = []
    for start, end in pairwise(record.bounds.tolist()):
        count = max(1, (end - start + length // 2) // length)
        firsts.append(start + length * np.arange(count))
    first = np.concatenate(firsts)
    return first, np.concatenate([first[1:], [len(record)]])


def survey(
    problem: Problem, p: Array, active: Sequence[int], record: Record, q: float = 0.0, length: int = PIECE
) -> Survey:
    """The free run of a model and its active candidates at parameters p over the record, or (q > 0) its filter's.

    `problem` gives everything but the record. Each run begins where its first piece of samples puts it.
    """
    first, last = pieces(record, length)
    outputs = record.y.shape[1]
    total, seen = np.zeros(outputs), np.zeros(outputs)
    square, count = np.zeros(len(first)), np.zeros(len(first), dtype=np.int64)
    layout = replace(problem.layout(active), columns=np.zeros(0, dtype=np.int64))
    finite = True
    for start, end in pairwise(record.bounds.tolist()):
        x0 = _begun(problem, p, active, record.part(start, min(end, start + PIECE)))
        for at, e, error in _passes(problem, Point(x0, p), layout, record, (start, end), q):
            if e is None or error is None:
                finite = False
                break
            there = np.isfinite(error)
            total += np.where(there, error, 0.0).T ** 2 @ np.ones(len(error))
            seen += there.sum(axis=0)
            where = np.searchsorted(first, np.arange(at, at + len(e)), side="right") - 1
            square += np.bincount(where, np.nansum(e**2, axis=1), len(first))
            count += np.bincount(where, there.sum(axis=1), len(first)).astype(np.int64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return Survey(
            np.sqrt(total / seen) if finite else np.full(outputs, np.inf), first, last, square / count, count, finite
        )


def _passes(
    problem: Problem, point: Point, layout: Layout, record: Record, run: tuple[int, int], q: float
) -> Iterator[tuple[int, Array | None, Array | None]]:
    """The chunks of a run: the first sample, errors in noise units and as measured, (samples, outputs) each, NaN where
    missing; None in their place where the simulation leaves the finite numbers, which ends it.
    """
    start, end = run
    wide = len(layout.states) * max(1, record.y.shape[1])
    chunk = min(CHUNK, max(PIECE, NUMBERS // wide))
    span = problem.delay(point.p)
    for at in range(start, end - 1, chunk):
        stop = min(at + chunk + 1, end)
        # What a delayed input was before the chunk.
        early = max(start, int(np.searchsorted(record.t[start:at], record.t[at] - span, side="right")) - 1 + start)
        inputs = problem.on(record.part(early, stop), point).inputs(point.p)[at - early :]
        part = record.part(at, stop)
        part = replace(part, y=without_spikes(problem.model, part, problem.R))
        here = problem.on(part, point)
        here.__dict__["step"] = problem.step
        passed = here.run(point, q, layout, u=np.ascontiguousarray(inputs))
        if not passed.finite:
            yield at, None, None
            return
        e = np.full(part.y.shape, np.nan)
        e[here.seen] = passed.e
        # The first sample of a chunk is the last of the one before.
        skip = int(at > start)
        yield at + skip, e[skip:], (part.y - passed.Y)[skip:]
        x0 = point.x0.copy()
        x0[0, layout.states] = passed.X[-1]
        point = Point(x0, point.p)


def _begun(problem: Problem, p: Array, active: Sequence[int], lead: Record) -> Array:
    """The first state of a run, (1, all states): as the model says, what it leaves open fitted to the first samples."""
    x0, free = first_states(problem.model, lead)
    start = Point(np.hstack([x0, np.zeros((1, problem.start.x0.shape[1] - x0.shape[1]))]), p)
    here = problem.on(lead, start, free_x0=free, frozen=True)
    for k in active:
        start = brought(here, start, k)
    if not len(here.layout(active).free):
        return start.x0
    return homotopy(here, start, active, first=0.1).exact.point.x0
