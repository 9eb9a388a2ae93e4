"""The verdict: how sure, in numbers and in words, from everything that was refitted."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

from suite.discovery import determined, misfit, separability, stated, words
from suite.discovery.colour import coloured
from suite.discovery.excerpt import excerpt
from suite.discovery.fit import Hypothesis, prepare
from suite.discovery.identify import ALARM, Search, search
from suite.discovery.library import MANY_STATES, candidates
from suite.discovery.long import LONG, search_long
from suite.discovery.outcome import curve, describe, errors, idle, parameters, white
from suite.discovery.result import Candidate, Verdict
from suite.discovery.weighing import Weighed, Weighing, excess, kind, size, weigh
from suite.effect import Effect
from suite.model import Model
from suite.record import Record

PLAUSIBLE = 0.99  # weight that the stated set holds
NEAR = 2.5  # times the best one's remaining error: what a rival may leave where nothing explains all of it


def diagnose(model: Model, record: Record, effects: Mapping[str, Effect], absolute: bool = False) -> Verdict:
    """Compare, search, judge: the verdict on one model and one record."""
    return judge(investigate(model, record, effects, absolute))[0]


def investigate(model: Model, record: Record, effects: Mapping[str, Effect], absolute: bool = False) -> Search:
    """Everything that was fitted to this record."""
    began = time.perf_counter()
    record = excerpt(model, record)
    problem = prepare(model, record, candidates(model, effects, absolute, record))
    found = search_long(problem) if len(record) > LONG else coloured(search(problem))
    return replace(found, seconds=time.perf_counter() - began)


def judge(found: Search) -> tuple[Verdict, Hypothesis]:
    """The verdict and the hypothesis it stands on."""
    began = time.perf_counter()
    problem, base = found.problem, found.base
    weighing = weigh(found)
    said = kind(found, weighing)
    named = weighing.best.hypothesis if said in ("missing_effect", "ambiguous") else base
    spared = idle(found, named) if said == "missing_effect" else ()
    if spared:
        # What is not fitted is not predicted any better by it: the fit alone is no proof.
        said = "ambiguous" if base.gain > ALARM else "adequate"
        named = named if said == "ambiguous" else base
        weighing = weighing.doubted()
    pairs = _plausible(found, weighing, named) if said != "adequate" else []
    names = list(problem.model.outputs)
    verdict = Verdict(
        said, "", tuple(describe(problem, named)), weighing.best.weight if named.active else 0.0,
        tuple(candidate for _, candidate in pairs),
        {
            "lambda": float(base.gain), "threshold": ALARM,
            "ljung_box_p": white(problem, base.exact, len(problem.columns(()))),
        },
        separability.smallest_detectable(found, named), stated.over_all(found, named, errors(found, named)),
        parameters(problem, named), 0.0,
    )  # fmt: skip
    advice: tuple[str, ...] = ()
    if said == "ambiguous":
        rivals = [h for h, _ in pairs if h is not named and size(problem, h) <= size(problem, named)]
        advice = separability.advice(found, named, rivals, verdict)
    if spared:
        advice = (*advice, words.idle([problem.terms[k].effect.id for k in spared]))
    advice = (*advice, *determined.findings(problem, named.exact, named.layout))
    if weighing.law is not None:
        advice = (*advice, words.law(*weighing.law))
    if problem.colour is not None:
        advice = (*advice, words.colour(names, problem.colour.tolist()))
    if problem.dropped:
        advice = (*advice, words.outliers(problem.dropped))
    states = len(problem.model.states)
    if states > MANY_STATES:
        advice = (*advice, words.many(states, len(problem.terms), len((found.block or found).fitted)))
    advice = (*advice, *stated.advice(found, named, verdict.error))
    verdict = replace(verdict, advice=advice, sentence=words.sentence(verdict, problem, weighing.settled))
    return replace(verdict, seconds=found.seconds + time.perf_counter() - began), named


def _plausible(found: Search, weighing: Weighing, named: Hypothesis) -> list[tuple[Hypothesis, Candidate]]:
    """The hypotheses that hold 99 % of the weight, and any other as simple as the best that the data cannot tell from
    it. Where the best leaves more than noise, weights cannot rule out what explains nearly as much: that too.
    """
    problem = found.problem
    best = weighing.best.hypothesis
    chosen: list[tuple[Hypothesis, Candidate]] = []
    held, total = 0.0, sum(entry.weight for entry in weighing.ranked)
    for place, entry in enumerate(weighing.ranked):
        hypothesis = entry.hypothesis
        if hypothesis.active and hypothesis.exact.passed.finite:
            separation = None
            if hypothesis is not best and place <= separability.SHOWN and best.active:
                separation = separability.apart(found, best, hypothesis)
            # What contains the best as a special case is never far from it; its weight alone speaks for it.
            simple = size(problem, hypothesis) <= size(problem, best)
            near = simple and separation is not None and separation < separability.SEPARABLE
            if not weighing.settled and len(hypothesis.active) <= len(best.active):
                near = near or excess(problem, hypothesis.exact) <= NEAR * excess(problem, best.exact)
            if held < PLAUSIBLE * total or near:
                chosen.append((hypothesis, _candidate(found, entry, hypothesis, separation)))
                # A shape's weight is counted with the physics that it cannot be told from.
                chosen += [(t, _candidate(found, replace(entry, weight=0.0), t, 0.0)) for t in entry.twins]
        held += entry.weight
    return chosen


def _candidate(found: Search, entry: Weighed, hypothesis: Hypothesis, separation: float | None) -> Candidate:
    problem = found.problem
    first = problem.terms[hypothesis.active[0]]
    return Candidate(
        tuple(describe(problem, hypothesis)),
        entry.weight,
        entry.criterion,
        misfit.rmse(problem.record, hypothesis.exact.passed.Y, list(problem.model.outputs)),
        separation,
        curve(problem, found.base, hypothesis, first.equation),
    )
