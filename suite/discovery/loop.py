"""The loop: compare, diagnose, add, again, until the error is noise or nothing helps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from suite.discovery import misfit, stated
from suite.discovery.discrepancy import discrepancy
from suite.discovery.excerpt import excerpt
from suite.discovery.fit import summarise
from suite.discovery.identify import Search
from suite.discovery.outcome import amended, residual
from suite.discovery.result import Ledger, Step, Verdict
from suite.discovery.verdict import investigate, judge
from suite.discovery.where import where
from suite.discovery.whiteness import whiteness
from suite.discovery.words import headline
from suite.effect import Effect
from suite.model import Model
from suite.record import Record

ROUNDS = 4  # effects are added at most this often


def discover(
    model: Model,
    record: Record,
    effects: Mapping[str, Effect],
    absolute: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Ledger:
    """Find what the model lacks, add it, and look again; every step is kept with its errors.

    The steps' models stand at the values fitted to the whole record; priors stay the file's throughout, so that
    nothing is learned twice from the same data. `progress` is told a sentence now and then.
    """
    # The same pieces of a very long record in every round, so that the errors compare.
    record = excerpt(model, record)
    steps: list[Step] = []
    history: list[dict[str, object]] = []
    current = model
    first: Verdict | None = None
    for number in range(ROUNDS + 1):
        progress(f"Step {number + 1}: comparing the model with {len(record)} samples")
        found = investigate(current, record, effects, absolute)
        verdict, named = judge(found)
        first = first or verdict
        step = step_of(found, verdict)
        steps.append(step)
        history.append(history_row(number, step, model))
        progress(verdict.sentence)
        if verdict.verdict not in ("missing_effect", "ambiguous") or number == ROUNDS or not named.active:
            break
        current = amended(found.problem, named, fitted=False)
    assert first is not None
    return Ledger(record, tuple(steps), conclusion(first, steps), tuple(history))


def step_of(found: Search, verdict: Verdict) -> Step:
    """A round of the loop: the base model at its fitted values beside the record, what is left of it, the verdict."""
    problem, base = found.problem, found.base
    fitted = summarise(problem, base)
    names = list(problem.model.outputs)
    over_all = stated.over_base(found, verdict.error)
    comparison = misfit.compare(fitted.model, problem.record, base.exact.passed.Y, problem.R**0.5, over_all)
    error = discrepancy(problem, base.exact.point)
    said = where(error, problem.record, problem.model)
    held = verdict.error.get("held_out", {}).get("before", {})
    return Step(
        fitted.model,
        replace(comparison, sentence=f"{comparison.sentence} {said}"),
        held,
        error,
        whiteness(problem.record, residual(problem, base.exact), names),
        verdict,
    )


def history_row(number: int, step: Step, original: Model) -> dict[str, object]:
    """One line of the ledger: what the model has gained so far, and its errors."""
    added = {
        name: step.model.parameters[name].value for name in step.model.parameters if name not in original.parameters
    }
    return {
        "step": number,
        "equations": dict(step.model.states),
        "added": added,
        "parameters": {name: p.value for name, p in step.model.parameters.items()},
        "error": dict(step.comparison.error),
        "held_out": dict(step.held_out),
        "verdict": step.verdict.verdict if step.verdict else "",
        "sentence": step.verdict.sentence if step.verdict else "",
    }


def conclusion(first: Verdict, steps: list[Step]) -> str:
    """The first verdict, and what the loop made of it."""
    if len(steps) == 1:
        return first.sentence
    start, end = steps[0].comparison, steps[-1].comparison
    falls = ", of ".join(
        f"{name} falls from {start.error[name]:.3g} to {end.error[name]:.3g} (noise {end.sigma[j]:.2g})"
        for j, name in enumerate(start.error)
    )
    last = steps[-1].verdict
    rest = {
        "adequate": "what remains is noise",
        "unexplained": "what remains is more than noise, and nothing in the library explains it",
        "ambiguous": "more may be missing, but the data cannot say what",
        "missing_effect": "more is missing",
    }[last.verdict if last else "adequate"]
    rounds = len(steps) - 1
    added = "one step" if rounds == 1 else f"{rounds} steps"
    return f"{headline(first)} In {added} the error of {falls}; {rest}."
