"""The engine: one pass of the prediction-error filter for any subset of the candidates, and its criterion.

L = n ln(mean e^2) + sum ln s + sum ((p - p0)/sd)^2, with the noise's common scale profiled out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.discovery.frame import Frame, Index, Layout, Point
from suite.discovery.noise import QUIETEST, spans
from suite.discovery.terms import Term
from suite.kernels.integrate import workspace
from suite.kernels.prediction import prediction_errors
from suite.record import Record

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pass:
    """One pass: e (M,) errors in noise units, J (M, theta), logs = sum ln s, Y (N, outputs), X (N, active states).

    Of an excerpt J is narrow, (M, first states of one run + parameters): each row has those of its own run, and `rows`
    (runs + 1,) says where the runs begin.
    """

    e: Array
    J: Array
    logs: float
    Y: Array
    X: Array
    finite: bool
    rows: Index | None = None

    def width(self, parameters: int) -> int:
        """How many numbers theta has, of which so many are parameters."""
        if self.rows is None:
            return int(self.J.shape[1])
        return (len(self.rows) - 1) * (int(self.J.shape[1]) - parameters) + parameters


@dataclass(frozen=True, eq=False)
class Problem(Frame):
    """A frame with its passes."""

    def run(self, point: Point, q: float, layout: Layout | None = None, u: Array | None = None) -> Pass:
        """One pass at process-noise level q, with the candidates of the layout on; `u` are the inputs where they are
        known already.

        J's columns: the free initial states of run 0, 1, ..., then the layout's parameters.
        """
        at = self.layout(()) if layout is None else layout
        program, record = self.program, self.record
        N, ny = record.y.shape
        n, m = len(at.states), len(at.columns)
        e, s, Y = np.zeros((N, ny)), np.ones((N, ny)), np.zeros((N, ny))
        X, J = np.zeros((N, n)), np.zeros((N, ny, n + m))
        wide = (n, n + m)
        scratch = (
            np.zeros(n), np.zeros(ny), np.zeros((ny, n)), np.zeros((ny, program.parameters)),
            np.zeros((n, n)), np.zeros((n, n)), np.zeros(wide), np.zeros(wide), np.zeros(wide), np.zeros(n),
        )  # fmt: skip
        Q = np.zeros(n)
        Q[: len(self.weights)] = q * 10.0 * self.weights**2 * self.step
        u = self.inputs(point.p) if u is None else u
        failed = prediction_errors(
            program.step_when(at.on), program.rate, program.output, record.t, u, self.linear, record.y, record.bounds,
            np.ascontiguousarray(point.x0[:, at.states]), point.p, at.on, at.columns, Q, self.R, self.angles,
            self.substeps, workspace(n, u.shape[1], program.parameters, m), scratch, e, s, J, X, Y,
        )  # fmt: skip
        seen = self.seen
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = float(np.log(s[seen]).sum())
        finite = failed < 0 and bool(np.isfinite(e).all())
        if self.colour is not None and q == 0.0 and finite:
            e, J = self.whitened(e), self.whitened(J)
            logs += float((seen.sum(axis=0) * np.log(1.0 - self.colour**2)).sum())
        return Pass(e[seen], self._scatter(J, at), logs, self._turned(Y), X, finite, self._rows)

    def whitened(self, e: Array) -> Array:
        """Errors (N, outputs) or their Jacobian (N, outputs, theta) less what the noise remembers, in its own units."""
        if self.colour is None:
            return e
        deep = (..., *(None,) * (e.ndim - 2))
        known = np.zeros(self.seen.shape, dtype=bool)
        known[1:] = self.seen[:-1]
        known[list(self.record.starts)] = False
        before = np.where(known[deep], np.roll(e, 1, axis=0), 0.0)
        left = np.sqrt(1.0 - self.colour**2)
        return np.where(known[deep], (e - self.colour[deep] * before) / left[deep], e)

    def coloured(self, rho: Array) -> Problem:
        """The same problem with sensors whose noise remembers."""
        return self.on(self.record, self.start, colour=rho)

    def _turned(self, Y: Array) -> Array:
        """Simulated angles in the turn of their measurement."""
        for j in np.flatnonzero(self.angles):
            rows = self.seen[:, j] & np.isfinite(Y[:, j])
            turns = np.round((self.record.y[rows, j] - Y[rows, j]) / (2.0 * np.pi))
            Y[rows, j] += 2.0 * np.pi * turns
        return Y

    def _scatter(self, J: Array, at: Layout) -> Array:
        """Each run's own initial-state columns at their place in theta; rows of missing samples left out."""
        n, free = len(at.states), at.free
        runs = len(self.record.starts)
        if runs == 1 or self._rows is not None:
            keep = np.concatenate([free, np.arange(n, J.shape[2])])
            return J[self.seen][:, keep]
        wide = np.zeros((*J.shape[:2], runs * len(free) + J.shape[2] - n))
        bounds = self.record.bounds
        for r in range(runs):
            rows = slice(bounds[r], bounds[r + 1])
            wide[rows, :, r * len(free) : (r + 1) * len(free)] = J[rows][:, :, free]
        wide[:, :, runs * len(free) :] = J[:, :, n:]
        return wide[self.seen]

    @cached_property
    def _rows(self) -> Index | None:
        """Of an excerpt, which has many runs, the measurement at which each begins, and their number: (runs + 1,)."""
        if self.record.whole is None:
            return None
        return np.concatenate([[0], np.cumsum(self.seen.sum(axis=1))])[self.record.bounds]

    def normal(self, passed: Pass, parameters: int) -> tuple[Array, Array]:
        """J'J and J'e of a pass whose last `parameters` columns are the layout's; a run's first states meet only the
        rows of that run.
        """
        if passed.rows is not None:
            return _by_runs(passed, passed.rows, parameters)
        J, e = passed.J, passed.e
        edge, runs = J.shape[1] - parameters, len(self.record.starts)
        if runs == 1 or edge == 0:
            return J.T @ J, J.T @ e
        A = np.zeros((J.shape[1], J.shape[1]))
        rows = np.concatenate([[0], np.cumsum(self.seen.sum(axis=1))])[self.record.bounds]
        free, shared = edge // runs, slice(edge, None)
        for r, (first, last) in enumerate(pairwise(rows)):
            own = slice(r * free, (r + 1) * free)
            mine, common = np.ascontiguousarray(J[first:last, own]), J[first:last, shared]
            A[own, own] = mine.T @ mine
            A[own, shared] = mine.T @ common
            A[shared, own] = A[own, shared].T
        common = np.ascontiguousarray(J[:, shared])
        A[shared, shared] = common.T @ common
        return A, J.T @ e

    def cost(self, passed: Pass, point: Point, layout: Layout) -> float:
        """L of a pass: n ln(mean e^2) + sum ln s + prior."""
        if not passed.finite:
            return np.inf
        mean, sd = self.prior
        columns = layout.columns
        with np.errstate(invalid="ignore", over="ignore"):
            pulls = ((point.p - mean) / sd)[columns]
            pull = float((pulls[np.isfinite(sd[columns])] ** 2).sum())
            if self.scale is not None:
                return float((passed.e**2).sum()) / self.scale + passed.logs + pull
        return float(len(passed.e) * np.log(self.noise(passed)) + passed.logs + pull)

    def noise(self, passed: Pass) -> float:
        """The noise's variance in units of R: given, or the mean squared error."""
        with np.errstate(over="ignore"):
            return self.scale if self.scale is not None else max(float(np.mean(passed.e**2)), self.quietest)

    @cached_property
    def quietest(self) -> float:
        """The noise's variance in units of R below which the integrator makes the error: noise-free data must not
        drive the criterion to minus infinity.
        """
        floor = float(np.min((QUIETEST * spans(self.record)) ** 2 / self.R))
        return min(max(floor, 1e-12), 1.0)

    def pack(self, point: Point, layout: Layout) -> Array:
        """Theta of a point."""
        return np.concatenate([point.x0[:, layout.states[layout.free]].ravel(), point.p[layout.columns]])

    def unpack(self, theta: Array, point: Point, layout: Layout) -> Point:
        """The point with theta in place, within bounds."""
        runs, free = len(point.x0), len(layout.free)
        x0, p = point.x0.copy(), point.p.copy()
        x0[:, layout.states[layout.free]] = theta[: runs * free].reshape(runs, free)
        low, high = self.limits
        p[layout.columns] = np.clip(theta[runs * free :], low[layout.columns], high[layout.columns])
        return Point(x0, p)

    def with_terms(self, terms: tuple[Term, ...]) -> Problem:
        """The same record and model beside other candidates; their parameters start at zero."""
        p = np.concatenate([self.start.p[: len(self.model.parameters)], np.zeros(sum(len(t.names) for t in terms))])
        x0 = self.start.x0[:, : len(self.model.states)]
        x0 = np.hstack([x0, np.zeros((len(x0), sum(len(t.states) for t in terms)))])
        return replace(self, terms=terms, start=Point(x0, p))

    def on(self, record: Record, start: Point, **changes: Any) -> Problem:
        """The same hypotheses beside another record; nothing is compiled again."""
        other = replace(self, record=record, start=start, **changes)
        other.__dict__["program"] = self.program
        return other


def _by_runs(passed: Pass, rows: Index, parameters: int) -> tuple[Array, Array]:
    """J'J and J'e of a pass whose J is narrow."""
    free, runs = passed.J.shape[1] - parameters, len(rows) - 1
    edge = runs * free
    A, g = np.zeros((edge + parameters, edge + parameters)), np.zeros(edge + parameters)
    for r, (first, last) in enumerate(pairwise(rows)):
        J = passed.J[first:last]
        product, own = J.T @ J, slice(r * free, (r + 1) * free)
        A[own, own], A[own, edge:], A[edge:, own] = product[:free, :free], product[:free, free:], product[free:, :free]
        A[edge:, edge:] += product[free:, free:]
        pull = J.T @ passed.e[first:last]
        g[own] = pull[:free]
        g[edge:] += pull[free:]
    return A, g
