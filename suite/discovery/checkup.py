"""Before an analysis: what is in the record, what the record cannot determine, and what would spoil a verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from suite import units
from suite.discovery import determined, words
from suite.discovery.engine import Problem
from suite.discovery.excerpt import excerpt
from suite.discovery.fit import Hypothesis, homotopy, levenberg_marquardt, prepare
from suite.discovery.identify import ALARM
from suite.discovery.mixups import mixups
from suite.discovery.noise import OUTLIER, noise_variance, spikes
from suite.model import Hold, Model
from suite.record import Record

Array = npt.NDArray[np.float64]

UNEVEN = 0.01  # relative variation of the steps from which sampling counts as irregular
LATEST = 5  # samples of input delay that are tried


@dataclass(frozen=True)
class Checkup:
    """What `check` found: facts as data, and findings as sentences (empty: nothing stands in the way)."""

    facts: dict[str, Any]
    findings: tuple[str, ...]


def check(model: Model, record: Record) -> Checkup:
    """Steps, gaps, outliers, noise, excitation, input delay, and null directions of the sensitivities."""
    findings: list[str] = []
    facts: dict[str, Any] = {"samples": len(record), "runs": len(record.starts)}
    facts["steps"] = _steps(record, findings)
    units.check(model)
    facts["outputs"] = _outputs(model, record, findings)
    facts["inputs"] = _inputs(model, record, findings)
    part = excerpt(model, record)
    problem = prepare(model, part)
    level = homotopy(problem, problem.start)
    at = level.exact if np.isfinite(level.exact.L) else level.best
    facts["undetermined"] = determined.facts(problem, at, level.layout)
    findings += determined.findings(problem, at, level.layout)
    findings += [mixup.sentence for mixup in mixups(model, part, level)[:1]]
    if model.inputs:
        _holds(problem, level, findings)
    facts["input_delay"] = _delays(problem, level.exact.point, findings) if model.inputs else {}
    if part.whole is not None:
        facts["excerpt"] = words.excerpt(len(record), len(part), len(part.starts))
    return Checkup(facts, tuple(findings))


def _steps(record: Record, findings: list[str]) -> dict[str, float]:
    steps = np.concatenate([run.dt for run in record.runs])
    median = float(np.median(steps))
    spread = float(steps.std() / median)
    if spread > UNEVEN:
        findings.append(f"Sampling is irregular: steps from {steps.min():.4g} to {steps.max():.4g}; that is allowed.")
    if steps.max() > 10 * median:
        findings.append(f"The longest gap is {steps.max():.4g}, {steps.max() / median:.0f} ordinary steps.")
    return {"median": median, "smallest": float(steps.min()), "largest": float(steps.max())}


def _outputs(model: Model, record: Record, findings: list[str]) -> dict[str, Any]:
    facts = {}
    sigma = np.sqrt(noise_variance(model, record))
    unknown = replace(model, outputs={name: replace(output, sigma=None) for name, output in model.outputs.items()})
    for j, (name, output) in enumerate(model.outputs.items()):
        y = record.y[:, j]
        there = ~np.isnan(y)
        span = float(np.ptp(y[there]))
        if span == 0.0:
            findings.append(f"{name} never changes; nothing can be learned from it.")
        changes = np.diff(y[there]) if there.sum() > 1 else np.zeros(1)
        typical = max(1.4826 * float(np.median(np.abs(changes - np.median(changes)))), 1e-300)
        outliers = int(spikes(y[there], max(float(sigma[j]), 0.2 * typical)).sum())
        levels = len(np.unique(y[there]))
        facts[name] = {
            "noise": float(sigma[j]), "given": output.sigma is not None, "range": span,
            "missing": int((~there).sum()), "outliers": outliers,
        }  # fmt: skip
        if outliers:
            findings.append(f"{name} has {outliers} spike(s) of more than {OUTLIER:g} noise deviations; look at them.")
        if (~there).mean() > 0.5:
            findings.append(f"{name} is missing in {100 * (~there).mean():.0f} % of the rows.")
        if span > 0 and sigma[j] > 0.3 * span:
            findings.append(f"{name} is mostly noise: {sigma[j]:.3g} against a range of {span:.3g}.")
        if there.sum() > 50 and levels < 20:
            findings.append(f"{name} takes only {levels} values; it may be quantised or saturated.")
        estimated = float(np.sqrt(noise_variance(unknown, record)[j]))
        if output.sigma is not None and there.sum() > 50 and not 1 / 3 < output.sigma / max(estimated, 1e-300) < 3:
            findings.append(
                f"{name} has sigma = {output.sigma:.3g} in the model file, but its samples scatter by {estimated:.3g}."
            )
        state = output.equation.strip()
        known = {s: start.value for s, start in model.initial.items() if not (start.estimate or output.angle)}
        for run in record.runs if state in known else ():
            if abs(run.y[0, j] - known[state]) > OUTLIER * max(float(sigma[j]), 0.01 * span):
                findings.append(
                    f"{state} starts at {known[state]:.4g} in the model file, but {name} at {run.y[0, j]:.4g} in "
                    f"{run.source}; correct it, or write estimate = true."
                )
        for edge, word in ((np.nanmax(y), "highest"), (np.nanmin(y), "lowest")):
            stuck = int((y == edge).sum())
            if stuck > max(5, 0.02 * len(y)) and levels > 20:
                findings.append(f"{name} stays at its {word} value {edge:.4g} in {stuck} samples; a saturated sensor?")
    return facts


def _inputs(model: Model, record: Record, findings: list[str]) -> dict[str, Any]:
    facts = {}
    for j, name in enumerate(model.inputs):
        u = record.u[:, j]
        span = float(np.ptp(u))
        facts[name] = {"range": span, "levels": len(np.unique(u))}
        if span == 0.0:
            findings.append(f"Input {name} is constant: nothing that depends on how it acts can be told from a bias.")
    return facts


def _holds(problem: Problem, level: Hypothesis, findings: list[str]) -> None:
    """Whether an input that is held otherwise between the samples fits better."""
    model = problem.model
    for name, entry in model.inputs.items():
        other: Hold = "linear" if entry.hold == "previous" else "previous"
        inputs = {**model.inputs, name: replace(entry, hold=other)}
        changed = replace(problem, model=replace(model, inputs=inputs))
        L = levenberg_marquardt(changed, level.exact.point, 0.0, (), 30, 1e-3).L
        if L < level.exact.L - ALARM:
            findings.append(
                f'Input {name} fits better with hold = "{other}"; a wrong hold looks like a missing effect.'
            )


def _delays(problem: Problem, point: Any, findings: list[str]) -> dict[str, int]:
    """Samples by which each input fits better when it comes later; 0 where that gains nothing."""
    found = {}
    base = float((problem.run(point, 0.0).e ** 2).sum())
    for j, name in enumerate(problem.model.inputs):
        best, chosen = base, 0
        for late in range(1, LATEST + 1):
            u = problem.record.u.copy()
            for first, last in zip(problem.record.bounds[:-1], problem.record.bounds[1:], strict=True):
                u[first + late : last, j] = problem.record.u[first : last - late, j]
            shifted = replace(problem, record=replace(problem.record, u=u)).run(point, 0.0)
            square = float((shifted.e**2).sum()) if shifted.finite else np.inf
            if square < 0.8 * best:
                best, chosen = square, late
        found[name] = chosen
        if chosen:
            findings.append(f"Input {name} fits better {chosen} sample(s) later; is it delayed, or its column shifted?")
    return found
