"""What each verb of the workbench does: read, call, print or write. Progress goes to standard error."""

from __future__ import annotations

import argparse
import difflib
import json
import math
import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from suite import plugins
from suite.discovery import checkup, misfit, stated
from suite.discovery.adding import added
from suite.discovery.evidence import evidence
from suite.discovery.excerpt import excerpt
from suite.discovery.fit import fit, prepare
from suite.discovery.growing import grown
from suite.discovery.library import candidates
from suite.discovery.loop import discover as loop
from suite.discovery.result import Verdict
from suite.discovery.terms import Term
from suite.discovery.verdict import diagnose as verdict_on
from suite.discovery.words import effect as effect_words
from suite.discovery.words import headline, value_sd, weight
from suite.errors import InputError
from suite.files import writable_folder, write_whole
from suite.model import Model, Parameter
from suite.model_file import read_model, to_toml, write_model
from suite.readers import read_record
from suite.record import Record
from suite.tables import write_csv

ALIASES = {"paper": "paper-cubic", "mug": "cooling-mug", "whiffle": "whiffle-ball"}
KNOWN_TO = 0.05  # of its value: how well a parameter of a simulated example is known, where its case is silent


def example(args: argparse.Namespace) -> int:
    """Write a case as model.toml and data files."""
    cases = plugins.cases()
    name = ALIASES.get(args.name, args.name)
    if name not in cases:
        raise InputError(f"no example {args.name!r}; choose one of {', '.join([*ALIASES, *cases])}")
    case = cases[name]
    model = case.deficient
    if case.truth is not None:
        if not math.isfinite(args.noise) or args.noise < 0:
            raise InputError(f"--noise: expected a fraction from 0, got {args.noise}; write --noise 0.05")
        if args.seed < 0:
            raise InputError(f"--seed: expected a whole number from 0, got {args.seed}; write --seed 1")
        record = case.simulate(args.noise, args.seed)[0]
        model = replace(model, parameters={n: _known(p) for n, p in model.parameters.items()})
    else:
        assert case.measured is not None
        record = case.measured(args.data)
    writable_folder(args.folder)
    written = [args.folder / "model.toml"]
    write_model(replace(model, time=model.time or "t"), written[0])
    for number, run in enumerate(record.runs):
        target = args.folder / ("data.csv" if len(record.runs) == 1 else f"data{number + 1}.csv")
        columns = {model.time or "t": run.t}
        columns |= {entry.column: run.u[:, j] for j, entry in enumerate(model.inputs.values())}
        columns |= {entry.column: run.y[:, j] for j, entry in enumerate(model.outputs.values())}
        write_csv(target, columns)
        written.append(target)
    names = [str(path) for path in written]
    if args.json:
        return _json({"name": name, "sentence": case.sentence, "files": names})
    print(case.sentence)
    print(f"Wrote {', '.join(names)}")
    print(f"Next: unmodelled discover {' '.join(map(shlex.quote, names))} -o {shlex.quote(str(args.folder / 'found'))}")
    return 0


def _known(parameter: Parameter) -> Parameter:
    """A parameter of an example with how well it is known, where the case does not say it."""
    said = parameter.fixed or parameter.free or parameter.sd is not None or parameter.value == 0
    return parameter if said else replace(parameter, sd=KNOWN_TO * abs(parameter.value))


def check(args: argparse.Namespace) -> int:
    """Print what is in the data and what would spoil an analysis."""
    model, record = _read(args)
    found = checkup.check(model, record)
    if args.json:
        _json({**found.facts, "findings": list(found.findings)})
        return 1 if args.strict and found.findings else 0
    steps = found.facts["steps"]
    print(f"{len(record)} samples in {len(record.starts)} run(s), step {steps['median']:.4g}")
    for name, facts in found.facts["outputs"].items():
        origin = "from the model file" if facts["given"] else "estimated"
        print(f"{name}: range {facts['range']:.4g}, noise {facts['noise']:.3g} ({origin}), {facts['missing']} missing")
    for name, facts in found.facts["inputs"].items():
        print(f"{name}: range {facts['range']:.4g}, {facts['levels']} values")
    if "excerpt" in found.facts:
        print(found.facts["excerpt"])
    for sentence in found.findings or ("Nothing stands in the way of an analysis.",):
        print(f"- {sentence}")
    return 1 if args.strict and found.findings else 0


def compare(args: argparse.Namespace) -> int:
    """Print how the model's free run compares with the data."""
    model, whole = _read(args)
    record = excerpt(model if args.refit else misfit.frozen(model), whole)
    if args.refit:
        model = fit(model, record).model
    found = misfit.compare(model, record)
    failing = evidence(model, record, found)
    said = stated.sentence(record, found)
    if args.json:
        noise = dict(zip(model.outputs, map(float, found.sigma), strict=True))
        numbers = {"fit": dict(found.fit), "error": dict(found.error), "noise": noise}
        part = {"excerpt": said} if said else {}
        return _json({**numbers, "worst": failing["worst"], "sentence": found.sentence, "where": failing, **part})
    print(*filter(None, [found.sentence, failing["sentence"], said]), sep="\n")
    return 0


def diagnose(args: argparse.Namespace) -> int:
    """Print the verdict."""
    model, record = _read(args)
    found = verdict_on(model, record, plugins.effects(), args.absolute)
    return _json(found.to_json()) if args.json else _say(found)


def _say(found: Verdict) -> int:
    print(found.sentence)
    if found.plausible:
        print("\nPlausible:")
    for candidate in found.plausible:
        label = ", ".join(effect_words(named) for named in candidate.effects)
        apart = "" if candidate.separation is None else f", delta^2 {candidate.separation:.3g}"
        print(f"  {weight(candidate.weight):>6}  {label}{apart}")
    for sentence in found.advice:
        print(f"- {sentence}")
    held = found.error.get("held_out")
    if held:
        for name in held["before"]:
            print(f"Held-out free-run error of {name}: {held['before'][name]:.3g} -> {held['after'][name]:.3g}")
    for name, entry in found.parameters.items():
        print(f"{name}: {entry['before']:.4g} -> {value_sd(entry['value'], entry['sd'])}")
    return 0


def add(args: argparse.Namespace) -> int:
    """Write the amended model and print the diff."""
    model = read_model(args.model)
    effects = plugins.effects() | {effect.id: effect for effect in model.effects}
    if args.effect not in effects:
        close = difflib.get_close_matches(args.effect, effects, 1)
        raise InputError(
            f"no effect {args.effect!r}; {f'did you mean {close[0]}? ' if close else ''}see `unmodelled list`"
        )
    term = chosen_term(model, args.effect, args.equation, args.term)
    record = read_record(args.data, model) if args.data else None
    new = grown(model, [term], [start_numbers(model, term, None)]) if record is None else added(model, record, term)
    write_model(new, args.output)
    before, after = to_toml(model).splitlines(), to_toml(new).splitlines()
    diff = list(difflib.unified_diff(before, after, str(args.model), str(args.output), lineterm="", n=1))
    if args.json:
        values = {name: new.parameters[name].value for name in new.parameters if name not in model.parameters}
        return _json(
            {
                "file": str(args.output),
                "term": term.shown,
                "equation": term.equation,
                "coefficients": values,
                "diff": diff,
            }
        )
    print("\n".join(diff))
    return 0


def chosen_term(model: Model, effect: str, equation: str | None, text: str | None = None) -> Term:
    """The one candidate that is meant; where several are, the sentence names them."""
    places = [*model.states, *model.outputs, *model.inputs]
    if equation is not None and equation not in places:
        raise InputError(f"--equation {equation}: nothing is called that; the model has {', '.join(places)}")
    library = {name: item for name, item in plugins.effects().items() if name == effect}
    every = candidates(model, library, absolute=True)
    terms = [t for t in every if t.effect.id == effect and equation in (None, t.equation)]
    if not terms:
        where = f" in {equation}" if equation else ""
        raise InputError(
            f"{effect} has no role to play{where}: nothing there is what it acts on; see docs/model-file.md"
        )
    equations = sorted({t.equation for t in terms})
    if len(equations) > 1:
        raise InputError(f"{effect} could act in {', '.join(equations)}; choose with --equation")
    texts = [t.text for t in terms]
    if text is not None and text not in texts:
        raise InputError(f"--term {text!r}: {effect} in {equations[0]} is {' or '.join(texts)}")
    if text is None and len(texts) > 1:
        raise InputError(f"{effect} in {equations[0]} could be {' or '.join(texts)}; choose with --term")
    return terms[texts.index(text) if text else 0]


def start_numbers(model: Model, term: Term, record: Record | None) -> Mapping[str, Parameter]:
    """Start values of a new term's parameters: coefficients zero, inner scales in the middle of the visited range."""
    free = {name: Parameter(0.0, free=True) for name in term.coefficients}
    free |= {z: Parameter(0.0) for z in term.states}
    if record is None:
        scales = {n: term.parameter(n, i.start, i.low, i.high) for n, i in term.inner.items()}
        return free | scales
    problem = prepare(model, record, (term,))
    low, high = problem.limits
    free |= {z: Parameter(float(problem.start.x0[0, j])) for z, j in zip(term.states, problem.states(0), strict=True)}
    for name, j in zip(term.names, problem.places(0), strict=True):
        free[name] = term.parameter(name, float(problem.start.p[j]), float(low[j]), float(high[j]))
    return free


def discover(args: argparse.Namespace) -> int:
    """Run the loop and write models, ledger, figures and report."""
    from suite.report.page import write_figures, write_report

    model, record = _read(args)
    effects = plugins.effects() | {effect.id: effect for effect in model.effects}
    # A folder that cannot be written is refused before minutes are spent.
    folder: Path = args.output
    writable_folder(folder)
    ledger = loop(model, record, effects, args.absolute, lambda text: print(text, file=sys.stderr))
    for number, step in enumerate(ledger.steps):
        write_model(step.model, folder / f"step{number}.toml")
    write_model(ledger.steps[-1].model, folder / "model.toml")
    write_whole(
        folder / "ledger.json",
        json.dumps(_finite({"sentence": ledger.sentence, "steps": list(ledger.history)}), indent=1),
    )
    given = " ".join(shlex.quote(str(path)) for path in [args.model, *args.data, "-o", folder])
    command = f"unmodelled discover {given}"
    write_figures(ledger, folder / "figures")
    first = ledger.steps[0].verdict
    assert first is not None
    write_report(ledger, folder / "report.html", command, headline(first), effects)
    if args.json:
        return _json(first.to_json())
    print(ledger.sentence)
    _table(ledger.history)
    print(f"Report: {folder / 'report.html'}")
    return 0


def _table(rows: Iterable[Mapping[str, Any]]) -> None:
    """The ledger, a line a step."""
    for row in rows:
        added = (
            ", ".join(f"{name} = {value:.4g}" for name, value in row["added"].items()) or "the model as given, refitted"
        )
        errors = ", ".join(f"{name} {value:.3g}" for name, value in row["error"].items())
        held = ", ".join(f"{name} {value:.3g}" for name, value in row["held_out"].items())
        print(f"  step {row['step']}: {added}: error {errors}" + (f" (held out {held})" if held else ""))


def _read(args: argparse.Namespace) -> tuple[Model, Record]:
    model = read_model(args.model)
    if not model.outputs:
        raise InputError(f"{args.model}: no outputs; add a table [outputs] that says what was measured")
    return model, read_record(args.data, model)


def _json(thing: Any) -> int:
    print(json.dumps(_finite(thing), indent=1, ensure_ascii=False))
    return 0


def _finite(thing: Any) -> Any:
    """The same with None where a number is not finite: JSON has no other word for it."""
    if isinstance(thing, Mapping):
        return {str(key): _finite(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_finite(value) for value in thing]
    if isinstance(thing, float) and not math.isfinite(thing):
        return None
    return thing
