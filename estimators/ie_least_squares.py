"""Invariant embedding with recursive least squares: coefficients of candidate terms, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite import expressions
from suite.along import rate_slopes
from suite.estimator import Estimate, Estimator
from suite.filtering import filtered, held
from suite.least_squares import MEMORY, LeastSquares
from suite.model import Model, Parameter
from suite.prior import prior_of
from suite.record import Record

Array = npt.NDArray[np.float64]

FEW = 12  # terms up to which the states of an equation are candidates beside a constant


def candidates(model: Model) -> dict[str, list[str]]:
    """Where nothing is named: a constant in each suspected equation, and in small models the states it depends on."""
    rates = dict(zip(model.states, model.rates, strict=True))
    found = {
        s: ["1", *(x for x in sorted(model.states) if expressions.symbol(x) in rates[s].free_symbols)]
        for s in model.suspects
    }
    return found if sum(map(len, found.values())) <= FEW else {s: ["1"] for s in model.suspects}


def _shapes(grown: Model, record: Record, X: Array, equations: Sequence[str]) -> Array:
    """The terms without their coefficients at the states X (N, n), (N, n, terms); each term is in one equation."""
    states, own = list(grown.states), len(grown.parameters) - len(equations)
    G = np.zeros((*X.shape, len(equations)))
    for i in sorted({states.index(equation) for equation in equations}):
        columns = [j for j, equation in enumerate(equations) if equation == states[i]]
        G[:, i, columns] = rate_slopes(grown, record, X, i, [own + j for j in columns])
    return G


class InvariantEmbeddingLeastSquares(Estimator):
    """Discrete IE of the model with candidate terms, whose coefficients are its recursive least squares.

    Raol (2016), (63)-(74); Friedland (1969) for the coefficients. `terms`: texts of the candidates by equation, in the
    model's names (default `candidates`); parameters: each coefficient, "text@equation", at the end of the run. d is the
    sum of the terms, P_d its covariance. The past counts less by 1/e each `memory` samples; `size` multiplies how large
    a term may be, over the square root of the prior's Q / dt. Definitions and other parameters are exact.
    """

    name = "ie-least-squares"
    tuning = {"memory": (20.0, 5000.0, "log"), "size": (0.01, 100.0, "log")}

    def estimate(
        self, model: Model, record: Record, memory: float = MEMORY, size: float = 1.0,
        terms: Mapping[str, Sequence[str]] | None = None,
    ) -> Estimate:  # fmt: skip
        prior, n, N = prior_of(record), len(model.states), len(record)
        dt = float(np.median(record.dt))
        chosen = [(s, text) for s, texts in (candidates(model) if terms is None else terms).items() for text in texts]
        grown, names = model, [f"rls{number}" for number in range(len(chosen))]
        for name, (state, text) in zip(names, chosen, strict=True):
            grown = grown.plus(state, f"+{name}*({text})", {name: Parameter(0.0, free=True)})
        path = filtered(model, record, prior.x0, prior.P0, prior.Q, prior.R)
        G = _shapes(grown, record, held(path.x, path.failed_at), [state for state, _ in chosen])
        with np.errstate(all="ignore"):
            rms = np.sqrt(np.mean(np.square(G.sum(axis=1)), axis=0))
        allowed = [np.sqrt(prior.Q[list(model.states).index(state)] / dt) for state, _ in chosen]
        sds = {
            name: size * float(most / scale) if np.isfinite(scale) and scale > 0.0 else 0.0
            for name, most, scale in zip(names, allowed, rms, strict=True)
        }
        # What an equation lacks its terms hold; one without terms keeps its noise.
        Q = np.where([state in dict(chosen) for state in model.states], 0.0, prior.Q)
        run = LeastSquares(grown, replace(prior, Q=Q), sds, {}, memory * dt, len(model.outputs))
        x, P, failed, m = np.zeros((N, n)), np.zeros((N, n, n)), None, len(chosen)
        values, covariances = np.zeros((N, m)), np.zeros((N, m, m))
        for k, (t, u, y) in enumerate(zip(record.t.tolist(), record.u, record.y, strict=True)):
            run.add(t, u, y)
            if run.filter.lost:
                failed = k
                break
            x[k], P[k] = run.filter.x[:n], run.filter.P[:n, :n]
            values[k], covariances[k] = run.value, run.covariance
        with np.errstate(all="ignore"):
            G = _shapes(grown, record, x, [state for state, _ in chosen])
            d, P_d = (G @ values[:, :, None])[:, :, 0], G @ covariances @ G.transpose(0, 2, 1)
        found = {f"{text}@{state}": float(a) for (state, text), a in zip(chosen, run.value, strict=True)}
        status, note = "ok", ""
        if failed is not None:
            status = "diverged"
            note = f"the filter diverged at t = {record.t[failed]:.4g} s; its last estimate is held from there"
            x, P, d, P_d = held(x, failed), held(P, failed), held(d, failed), held(P_d, failed)
        report = {f"sd of {key}": float(sd) for key, sd in zip(found, run.sd, strict=True)}
        return Estimate(x=x, P=P, d=d, P_d=P_d, parameters=found, status=status, note=note, report=report)
