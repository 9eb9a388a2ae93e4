"""The report of a run of discovery: one file that opens anywhere, without scripts and without a network."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date as calendar
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from suite import __version__
from suite.discovery.result import Candidate, Ledger, Step, Verdict
from suite.discovery.whiteness import band
from suite.effect import Effect
from suite.files import write_whole
from suite.model import Model
from suite.report import correlation, failure, figures
from suite.report.canvas import MOST
from suite.report.figures import SEPARABLE, change, plain
from suite.report.vector import share, svg

# Points of all curves together, at about 17 bytes each.
POINTS = 50_000

DETECTION = {
    "lambda": "likelihood that a free model error gains (lambda)",
    "threshold": "alarm above",
    "ljung_box_p": "chance of a residual so regular if it were white (Ljung-Box)",
}


def write_report(
    ledger: Ledger,
    path: Path,
    command: str = "",
    sentence: str = "",
    effects: Mapping[str, Effect] | None = None,
    date: str = "",
) -> Path:
    """Write the report to `path`, which is replaced at once or not at all.

    `command` is the line that repeats the run, `sentence` the judgement (the ledger's if empty), `effects` the library
    by id, from which each effect takes its sentence of physics, `date` the day it was made (today if empty).
    """
    write_whole(path, _page(ledger, command, sentence, effects or {}, date))
    return Path(path)


def write_figures(ledger: Ledger, folder: Path) -> list[Path]:
    """Write each figure as an SVG file of its own into `folder`; returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {"waterfall": figures.waterfall(ledger)}
    for k, step in enumerate(ledger.steps):
        drawn |= {f"step{k}-{name}": fig for name, fig in _drawn(ledger, step, MOST).items()}
    written = []
    for name, fig in drawn.items():
        write_whole(folder / f"{name}.svg", svg(fig, name))
        written.append(folder / f"{name}.svg")
    return written


def _drawn(ledger: Ledger, step: Step, most: int) -> dict[str, Figure]:
    """The figures of one step by name; those for which there are no data are left out."""
    model, record = step.model, ledger.record
    drawn = {"compare": figures.compare(model, record, step.comparison, most)}
    best = step.verdict.plausible[0] if step.verdict is not None and step.verdict.plausible else None
    if step.discrepancy is not None:
        # A term of another equation does not belong over this one's error.
        here = best if best and any(named.equation == step.discrepancy.equation for named in best.effects) else None
        drawn["discrepancy"] = failure.discrepancy(model, record, step.discrepancy, here, most)
        chart = failure.state_map(model, step.discrepancy)
        if chart is not None:
            drawn["map"] = chart
    if best is not None and step.verdict is not None:
        drawn["candidates"] = figures.candidates(step.verdict)
    if step.autocorrelation:
        drawn["autocorrelation"] = correlation.autocorrelation(model, record, step.autocorrelation)
        crossed = correlation.cross(model, record, step.comparison)
        if crossed is not None:
            drawn["cross"] = crossed
    return drawn


def number(value: object) -> str:
    """A number with three digits, a dash where there is none."""
    if not isinstance(value, int | float) or value != value:
        return "–"
    return f"{value:.3g}" if abs(value) < 1000 or abs(value) >= 1e6 else f"{value:.0f}"


def with_sd(value: float, sd: float) -> str:
    """Value ± sd, the value to the digit that the sd reaches."""
    if not sd > 0 or sd == float("inf"):
        return number(value)
    short = f"{sd:.2g}"
    digits = len(short.partition(".")[2]) if "e" not in short else None
    return f"{value:.4g} ± {short}" if digits is None else f"{value:.{digits}f} ± {short}"


def _page(ledger: Ledger, command: str, sentence: str, effects: Mapping[str, Effect], date: str) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "plain": plain}
    # Each output has three curves, a discrepancy about seven.
    curves = sum(3 * len(step.model.outputs) + 7 for step in ledger.steps)
    most = int(np.clip(POINTS / curves, 200, MOST))
    drawn = {"waterfall": svg(figures.waterfall(ledger), "waterfall")}
    for k, step in enumerate(ledger.steps):
        drawn |= {f"step{k}-{name}": svg(fig, f"step{k}-{name}") for name, fig in _drawn(ledger, step, most).items()}
    shared, letters = share(drawn)
    steps = [_step(ledger, k, effects) for k in range(len(ledger.steps))]
    columns = list(dict.fromkeys(name for row in ledger.history for name in row))
    return environment.get_template("report.html.j2").render(
        model=ledger.steps[-1].model.name,
        sentence=sentence or ledger.sentence,
        # A short judgement on top leaves the rest of the ledger's for the line below.
        lead=ledger.sentence.removeprefix(sentence).strip() if sentence else "",
        keys=_keys(ledger),
        letters=Markup(letters),
        figures={name: Markup(text) for name, text in shared.items()},
        steps=steps,
        columns=columns,
        rows=[[_cell(row.get(name)) for name in columns] for row in ledger.history],
        source=ledger.record.source,
        samples=len(ledger.record),
        runs=len(ledger.record.starts),
        command=command,
        version=__version__,
        date=date or calendar.today().isoformat(),
        separable=number(SEPARABLE),
    )


def _cell(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_cell(entry)}" for name, entry in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(_cell(entry) for entry in value)
    if isinstance(value, float):
        return number(value)
    return "–" if value is None else str(value)


def _keys(ledger: Ledger) -> list[dict[str, object]]:
    """Error before and after, noise, and held-out error of each output."""
    first, last = ledger.steps[0], ledger.steps[-1]
    return [
        {
            "output": name,
            "before": first.comparison.error[name],
            "after": last.comparison.error[name],
            "noise": float(last.comparison.sigma[j]),
            "held_before": first.held_out.get(name),
            "held_after": last.held_out.get(name),
        }
        for j, name in enumerate(last.model.outputs)
    ]


def _step(ledger: Ledger, at: int, effects: Mapping[str, Effect]) -> dict[str, Any]:
    step = ledger.steps[at]
    previous = ledger.steps[at - 1].model if at else None
    verdict = step.verdict
    return {
        "number": at,
        "prefix": f"step{at}-",
        "change": change(ledger.steps, at),
        "equations": _equations(step.model, previous),
        "comparison": step.comparison,
        "discrepancy": step.discrepancy,
        "verdict": verdict,
        "candidates": [] if verdict is None else [_candidate(c, k, effects) for k, c in enumerate(verdict.plausible)],
        "lookalikes": [] if verdict is None else _lookalikes(verdict),
        "parameters": _parameters(step, previous),
        "detection": [] if verdict is None else [(DETECTION.get(k, plain(k)), v) for k, v in verdict.detection.items()],
        "smallest": [] if verdict is None else [(plain(k), v) for k, v in verdict.smallest_detectable.items()],
        "whiteness": _whiteness(ledger, step),
    }


def _equations(model: Model, previous: Model | None) -> list[dict[str, str]]:
    """Left side, the text that was there before, and the text that is new in this step (`added`)."""
    old = {} if previous is None else dict(_sides(previous))
    rows = []
    for name, text in _sides(model):
        known = old.get(name)
        if previous is None or known == text:
            rows.append({"name": name, "kept": text, "added": ""})
        elif known is not None and text.startswith(known):
            rows.append({"name": name, "kept": known, "added": text[len(known) :]})
        else:
            rows.append({"name": name, "kept": "", "added": text})
    return rows


def _sides(model: Model) -> list[tuple[str, str]]:
    rates = [(f"{name}'", text) for name, text in model.states.items()]
    return rates + [(name, output.equation) for name, output in model.outputs.items()]


def _candidate(candidate: Candidate, rank: int, effects: Mapping[str, Effect]) -> dict[str, Any]:
    apart = candidate.separation
    judgement = "the best" if rank == 0 else "–"
    if apart is not None and rank > 0:
        judgement = f"{number(apart)}, {'no' if apart < SEPARABLE else 'yes'}"
    return {
        "effects": [
            {
                "name": plain(named.effect),
                "equation": named.equation,
                "term": named.term,
                "physics": effects[named.effect].sentence if named.effect in effects else "",
                "coefficients": [
                    f"{name} = {with_sd(c.value, c.sd)}{' ' + c.unit if c.unit else ''}"
                    for name, c in named.coefficients.items()
                ],
            }
            for named in candidate.effects
        ],
        "weight": f"{100 * candidate.weight:.0f} %" if candidate.weight >= 0.005 else "< 1 %",
        "apart": judgement,
        "error": [(name, number(value)) for name, value in candidate.error.items()],
    }


def _lookalikes(verdict: Verdict) -> list[str]:
    """For each rival that these data cannot exclude, what a person should know, in a sentence."""
    said = []
    for rival in verdict.plausible[1:]:
        if rival.separation is None or rival.separation >= SEPARABLE:
            continue
        names = " with ".join(f"{plain(named.effect)} in {named.equation}" for named in rival.effects)
        said.append(
            f"{names[:1].upper()}{names[1:]} fits nearly as well ({100 * rival.weight:.0f} % of the weight): with its "
            f"coefficients refitted it comes within a separation of {number(rival.separation)} of the best hypothesis; "
            f"below {number(SEPARABLE)} the data cannot tell the two apart."
        )
    return said


def _parameters(step: Step, previous: Model | None) -> list[dict[str, str]]:
    """Value before and after this step's fit with its sd, and what is special about it."""
    known = step.model.parameters
    fitted = step.verdict.parameters if step.verdict is not None else {}
    rows = []
    for name in dict.fromkeys((*known, *fitted)):
        parameter, entry = known.get(name), fitted.get(name, {})
        value, sd = entry.get("value", parameter.value if parameter else float("nan")), entry.get("sd", 0.0)
        new = previous is not None and name not in previous.parameters
        before = entry.get("before", float("nan") if entry or new or parameter is None else parameter.value)
        rows.append(
            {
                "name": name,
                "unit": (parameter.unit or "") if parameter else "",
                "before": number(before),
                "after": with_sd(value, sd),
                "note": "fixed" if parameter is not None and parameter.fixed else "new in this step" if new else "",
            }
        )
    return rows


def _whiteness(ledger: Ledger, step: Step) -> list[dict[str, Any]]:
    columns = {name: j for j, name in enumerate(step.model.outputs)}
    rows = []
    for name, r in step.autocorrelation.items():
        beyond = int((np.abs(r) > band(ledger.record, columns[name])).sum())
        rows.append({"output": name, "lags": len(r), "beyond": beyond, "expected": 0.01 * len(r)})
    return rows
