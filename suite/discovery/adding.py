"""One chosen term added to a model, both fitted to a record."""

from __future__ import annotations

from suite.discovery.excerpt import excerpt
from suite.discovery.fit import homotopy, polish, prepare
from suite.discovery.identify import refit
from suite.discovery.outcome import amended
from suite.discovery.scoring import score
from suite.discovery.terms import Term
from suite.model import Model
from suite.record import Record


def added(model: Model, record: Record, term: Term) -> Model:
    """The amended model at the fitted values, found as the search finds them: from where the score points, and from
    zero. An effect with a state of its own often stays at zero when it starts there.
    """
    problem = prepare(model, excerpt(model, record), (term,))
    base = polish(problem, homotopy(problem, problem.start))
    return amended(problem, polish(problem, refit(problem, base, (0,), score(problem, base)[:1])))
