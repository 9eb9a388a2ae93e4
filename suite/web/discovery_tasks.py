"""One round of discovery for the page, and the report of several rounds."""

from __future__ import annotations

import pickle
import shlex
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from suite import plugins
from suite.discovery import loop
from suite.discovery.library import candidates
from suite.discovery.result import Ledger, Step
from suite.discovery.verdict import investigate, judge
from suite.discovery.words import headline as judgement
from suite.errors import InputError
from suite.model import Model
from suite.model_text import to_toml
from suite.record import Record
from suite.report.page import write_report
from suite.web import verdict_payload
from suite.web.opened import both
from suite.web.payloads import text
from suite.web.step_payload import step as step_payload

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Analysis:
    """One round as the server keeps it for a report: the model given, the record, the step."""

    given: Model
    record: Record
    step: Step


def analyse(source: str, files: Sequence[tuple[str, str]], absolute: bool, key: str, tell: Tell) -> tuple[str, bytes]:
    """The object ANALYSIS as text, and the round pickled, which only a process of the same server reads again."""
    tell("Reading the data")
    model, record = both(source, tuple(files))
    effects = plugins.effects() | {effect.id: effect for effect in model.effects}
    tell(f"Comparing the model with {len(record)} samples")
    count = len(candidates(model, effects, absolute, record))
    tell(f"Trying {count} effects on {len(record)} samples")
    found = investigate(model, record, effects, absolute)
    tell(f"Judging {len(found.fitted)} hypotheses")
    verdict, _ = judge(found)
    tell("Smoothing the model error")
    step = loop.step_of(found, verdict)
    shown = step_payload(step.model, record, step.comparison, step.discrepancy, step.held_out, step.autocorrelation)
    said = {
        "id": key,
        "headline": verdict_payload.headline(verdict, step, record),
        "model": to_toml(step.model),
        "step": shown,
        "verdict": verdict_payload.verdict(found, verdict, step, record, effects),
    }
    # The report shows the excerpt of a very long record; the rest need not be kept.
    kept = Analysis(bare(model), replace(record, whole=None), replace(step, model=bare(step.model)))
    return text(said), pickle.dumps(kept)


def bare(model: Model) -> Model:
    """The model without what it has compiled, which cannot leave the process."""
    return replace(model)


def report(kept: Sequence[bytes], tell: Tell) -> str:
    """report.html of the rounds in this order, as `discover` writes it."""
    rounds: list[Analysis] = [pickle.loads(blob) for blob in kept]
    if not rounds:
        raise InputError("no analyses; press Analyse first")
    first = rounds[0]
    if any(entry.record.source != first.record.source for entry in rounds):
        raise InputError("the analyses are of different data; a report holds those of one record")
    steps = tuple(entry.step for entry in rounds)
    history: list[dict[str, Any]] = [loop.history_row(k, step, first.given) for k, step in enumerate(steps)]
    verdict = steps[0].verdict
    assert verdict is not None
    ledger = Ledger(first.record, steps, loop.conclusion(verdict, list(steps)), tuple(history))
    names = " ".join(shlex.quote(name) for name in first.record.names)
    effects = plugins.effects() | {effect.id: effect for effect in first.given.effects}
    with tempfile.TemporaryDirectory(prefix="unmodelled-") as folder:
        command = f"unmodelled discover model.toml {names} -o found"
        path = write_report(ledger, Path(folder) / "report.html", command, judgement(verdict), effects)
        return path.read_text(encoding="utf-8")
