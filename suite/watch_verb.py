"""The verb `watch`: lines of CSV in, a line a sample out, at once."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np

from suite.errors import DataError, InputError
from suite.model import Model
from suite.model_file import read_model
from suite.record import Record
from suite.sample_lines import Sample, lines_of, samples
from suite.watch import FALSE_ALARMS, Reading, Watcher

FIRST, FIRST_BLIND = 40, 200  # samples to set up on: where the sensors' noise is stated, and where it is not
ENCODE = json.JSONEncoder(ensure_ascii=False).encode  # json.dumps would make one a sample
LEAST = 8  # readings of every output that it takes to see its noise


def run(args: argparse.Namespace) -> int:
    """Watch until the input ends. A broken line ends it too, once what was good is written."""
    _sound(args)
    model = read_model(args.model)
    blind = any(output.sigma is None for output in model.outputs.values())
    count = args.first or (FIRST_BLIND if blind else FIRST)
    source = "standard input" if args.data == "-" else args.data
    alarmed = False
    with _opened(args.data) as stream:
        coming = samples(lines_of(stream, source), model, source)
        first, broken = _first(coming, count, len(model.outputs))
        if broken is not None and len(first) < 2:
            raise broken
        record = _record(model, first, source)
        watcher, write = _set_up(args, model, record)
        for reading in _readings(watcher, chain(first, coming if broken is None else ())):
            alarmed |= reading.since is not None
            print(write(reading), flush=True)
    if broken is not None:
        raise broken
    return 1 if args.strict and alarmed else 0


def _sound(args: argparse.Namespace) -> None:
    """Refuse numbers that mean nothing."""
    if args.false_alarms is not None and not 1e-9 <= args.false_alarms <= 0.1:
        raise InputError(f"--false-alarms: expected 1e-9 to 0.1 a sample, got {args.false_alarms:g}; write 1e-5")
    if args.first is not None and args.first < 2:
        raise InputError(f"--first: expected 2 samples at least, got {args.first}; write --first 40")
    if args.memory is not None and not 0.0 < args.memory < math.inf:
        raise InputError(f"--memory: expected a time above 0, got {args.memory:g}; write --memory 10")
    if args.equation is not None and args.effect is None:
        raise InputError("--equation says where an effect acts; name the effect too with --effect")


def _opened(data: str) -> Any:
    """The lines: a file's, or those of standard input, which stays open."""
    if data == "-":
        return open(sys.stdin.fileno(), encoding="utf-8-sig", errors="replace", closefd=False)
    return open(data, encoding="utf-8-sig", errors="replace")


def _first(coming: Iterator[Sample], count: int, outputs: int) -> tuple[list[Sample], DataError | None]:
    """The first samples, more than `count` if an output is seldom read, and the error that cut them short."""
    found: list[Sample] = []
    seen = np.zeros(outputs)
    try:
        for sample in coming:
            found.append(sample)
            seen += ~np.isnan(sample[2])
            if len(found) >= count and seen.min() >= LEAST:
                break
    except DataError as error:
        return found, error
    return found, None


def _record(model: Model, first: Sequence[Sample], source: str) -> Record:
    if len(first) < 2:
        raise DataError(f"{source}: {len(first)} sample(s), at least 2 are needed; add measurements")
    t, u, y = zip(*first, strict=True)
    record = Record(np.array(t), np.array(u), np.array(y), names=(source,), source=source)
    for c, (name, output) in enumerate(model.outputs.items()):
        if np.isnan(record.y[:, c]).all():
            raise DataError(
                f"{source}, column {output.column}: no value for the output {name}; leave it out or measure it"
            )
    return record


def _set_up(args: argparse.Namespace, model: Model, record: Record) -> tuple[Watcher, Callable[[Reading], str]]:
    """The watcher, and what writes its readings; the header of a CSV is written here."""
    effect, names, equation = _effect(args, model, record)
    rate = FALSE_ALARMS if args.false_alarms is None else args.false_alarms
    watcher = Watcher(model, record, effect, names, exact=args.exact, memory=args.memory, rate=rate)
    if args.json:
        return watcher, lambda reading: _as_json(model, names, args.effect, equation, reading)
    columns = ["t", *(f"innovation_{name}" for name in model.outputs)]
    for name in (*(f"d_{name}" for name in model.suspects), *names):
        columns += [name, f"{name}_sd"]
    print(",".join([*columns, "statistic", "alarm_since"]), flush=True)
    return watcher, _as_csv


def _effect(args: argparse.Namespace, model: Model, record: Record) -> tuple[Model | None, tuple[str, ...], str]:
    """The model with the effect, its coefficients' names, and the equation; inner scales are where a search starts."""
    if args.effect is None:
        return None, (), ""
    from suite.discovery.growing import grown
    from suite.verbs import chosen_term, start_numbers

    term = chosen_term(model, args.effect, args.equation, args.term)
    if term.effect.pinned or term.states or "__" in term.text:
        kind = "brings a state of its own" if term.states else "has no coefficient that multiplies it"
        raise InputError(f"--effect {args.effect}: it {kind}, so it cannot be followed; choose another, or none for d")
    new = grown(model, [term], [start_numbers(model, term, record)])
    own = [name for name in new.parameters if name not in model.parameters]
    return new, tuple(own[: len(term.coefficients)]), term.equation


def _readings(watcher: Watcher, coming: Iterator[Sample]) -> Iterator[Reading]:
    lost = False
    for t, u, y in coming:
        reading = watcher.add(t, u, y)
        if reading.lost and not lost:
            print(f"unmodelled: a filter was lost at t = {t:g}; what it says stands still from there", file=sys.stderr)
            lost = True
        yield reading


def _as_csv(reading: Reading) -> str:
    numbers = reading.innovation.tolist()
    for values, sds in ((reading.d, reading.d_sd), (reading.coefficients, reading.coefficients_sd)):
        for pair in zip(values.tolist(), sds.tolist(), strict=True):
            numbers += pair
    numbers.append(reading.statistic)
    cells = [f"{number:.6g}" if math.isfinite(number) else "" for number in numbers]
    return ",".join([repr(reading.t), *cells, "" if reading.since is None else repr(reading.since)])


def _as_json(model: Model, names: Sequence[str], effect: str | None, equation: str, reading: Reading) -> str:
    def pairs(keys: Sequence[str], values: Any, sds: Any) -> dict[str, dict[str, float | None]]:
        return {
            key: {"value": _finite(value), "sd": _finite(sd)}
            for key, value, sd in zip(keys, values.tolist(), sds.tolist(), strict=True)
        }

    found = pairs(names, reading.coefficients, reading.coefficients_sd)
    return ENCODE(
        {
            "t": reading.t,
            "innovation": {
                name: _finite(e) for name, e in zip(model.outputs, reading.innovation.tolist(), strict=True)
            },
            "d": pairs(model.suspects, reading.d, reading.d_sd),
            "effect": None if effect is None else {"effect": effect, "equation": equation, "coefficients": found},
            "statistic": reading.statistic,
            "alarm": None if reading.since is None else {"since": reading.since},
        }
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
