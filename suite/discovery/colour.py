"""Coloured sensor noise: where what remains is not a missing effect but noise with a memory.

Each output's noise may follow its own past, v_k = rho v_(k-1) + white. Whitening the errors and their Jacobian by
e_k - rho e_(k-1) makes the same criterion hold for it, and every weight honest again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from suite.discovery.abreast import each
from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis, Level, levenberg_marquardt
from suite.discovery.identify import ALARM, REFITTED, Search, needs_more, refit
from suite.discovery.outcome import residual, white
from suite.discovery.scoring import score
from suite.discovery.whiteness import whiteness

Array = npt.NDArray[np.float64]

WHITE = 1e-3  # Ljung-Box p below which a residual is not white
STRONGEST = 0.98  # the largest memory that is still taken for noise


def coloured(found: Search) -> Search:
    """The search with the noise's memory as part of the model, where that explains what remains better than any
    process noise and leaves a white residual; else the search as it is.
    """
    problem = found.problem
    best = min([found.base, *found.fitted], key=found.criterion)
    if problem.colour is not None or not best.exact.passed.finite:
        return found
    if not needs_more(found, best) and white(problem, best.exact) > WHITE:
        return found
    rho = memory(problem, best.exact)
    if not (np.abs(rho) > 2.0 / np.sqrt(problem.count / len(rho))).any():
        return found
    changed = problem.coloured(rho)
    sound = [h for h in (found.base, *found.fitted) if h.exact.passed.finite]
    hypotheses = each(lambda h: _refitted(changed, h), sound)
    if not hypotheses or hypotheses[0].active:
        return found
    base, fitted = hypotheses[0], hypotheses[1:]
    trial = Search(changed, base, tuple(fitted), found.absorbed, found.frequencies, found.scores, found.seconds)
    known = {frozenset(h.active) for h in fitted}
    fresh = [s for s in score(changed, base, found.absorbed, exact=True)[:REFITTED] if frozenset([s.k]) not in known]
    more = each(lambda s: refit(changed, base, (s.k,), [s]), (s for s in fresh if s.LM > ALARM))
    trial = replace(trial, fitted=(*fitted, *more))
    chosen = min([trial.base, *trial.fitted], key=trial.criterion)
    price = len(rho) * np.log(problem.count)
    rival = min(found.criterion(h, h.best) for h in (found.base, *found.fitted))
    better = trial.criterion(chosen) + price < rival - ALARM
    return trial if better and white(changed, chosen.exact) > WHITE else found


def memory(problem: Problem, level: Level) -> Array:
    """The lag-one correlation of each output's residual, (outputs,)."""
    r = whiteness(problem.record, residual(problem, level), list(problem.model.outputs))
    return np.array([np.clip(values[0], -STRONGEST, STRONGEST) for values in r.values()])


def _refitted(problem: Problem, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis at q = 0 alone: a memory of the sensor's noise stands in place of a process noise."""
    level = levenberg_marquardt(problem, hypothesis.exact.point, 0.0, hypothesis.active, 30, 1e-3)
    return Hypothesis(hypothesis.active, (level,), problem.layout(hypothesis.active))
