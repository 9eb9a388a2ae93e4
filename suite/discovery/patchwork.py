"""Hypotheses that say less than they seem to: patchworks of one law, and effects that ended at nothing."""

from __future__ import annotations

from suite.discovery.engine import Problem
from suite.discovery.fit import Hypothesis
from suite.discovery.library import triage


def patched(problem: Problem, hypothesis: Hypothesis) -> bool:
    """Whether effects stand in for one law that the library does not hold: `doubled` ones, at the price of one law less
    than they are, or a shape that stands for no physics at all.
    """
    terms = [problem.terms[k] for k in hypothesis.active]
    return doubled(problem, hypothesis) or any(term.effect.generic and term.effect.inner for term in terms)


def doubled(problem: Problem, hypothesis: Hypothesis) -> bool:
    """Whether effects of one law act together in one equation, or two faults of the instruments, which imitate
    anything as well.
    """
    terms = [problem.terms[k] for k in hypothesis.active]
    laws = [(term.equation, term.effect.law) for term in terms if term.effect.law]
    return len(laws) > len(set(laws)) or sum(map(triage, terms)) > 1


def hollow(problem: Problem, hypothesis: Hypothesis) -> bool:
    """Whether a coefficient that cannot be negative ended at zero: a simpler hypothesis says the same."""
    p = hypothesis.exact.point.p
    return any(
        term.effect.sign and (p[problem.places(k)[: len(term.coefficients)]] == 0.0).any()
        for k, term in ((k, problem.terms[k]) for k in hypothesis.active)
    )
