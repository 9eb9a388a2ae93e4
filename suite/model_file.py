"""The model file: TOML to Model and back. Comments are lost on the way, nothing else."""

from __future__ import annotations

import math
import os
import re
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from suite.document import Document, said
from suite.errors import ModelError
from suite.files import write_whole
from suite.model import Hold, Initial, Input, Model, Output, Parameter
from suite.model_effects import effects
from suite.model_text import to_toml as to_toml
from suite.units import check

LARGEST = 100_000  # bytes; the largest of the package has some thousands
MOST_PARTS = 100  # of a dotted key, which is read in a time with the square of its parts
QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'|#.*")
BETWEEN = re.compile(r"[^\w\-. \t]")
MOST_ENTRIES = 1000  # of all tables and effects together
MOST_LETTERS = 30_000  # of all equations together; 30 us each at worst
TABLES = ("states", "parameters", "inputs", "outputs", "initial", "suspect", "units")
KEYS = ("name", "time", *TABLES, "effects")


def read_model(path: str | os.PathLike[str]) -> Model:
    """The model in a file. Raises ModelError: one sentence with the file, the place, what came and the mend."""
    file = Path(path)
    return from_toml(_text(file), file.name)


def from_toml(text: str, source: str = "model") -> Model:
    """The model in a text; `source` opens every error sentence."""
    _refuse_large(text, source)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{source}: not valid TOML: {_lower(str(error))}; mend that line") from None
    except (RecursionError, ValueError):
        raise ModelError(f"{source}: not valid TOML: nested too deeply or a number too long; simplify it") from None
    return _Reader(source).model(document)


def write_model(model: Model, path: str | os.PathLike[str]) -> None:
    """Write the model's file: whole or not at all, also where the process is killed meanwhile."""
    write_whole(Path(path), to_toml(model))


def _refuse_large(text: str, source: str) -> None:
    """Refuse what would take longer to read than a model may."""
    if len(text) > LARGEST:
        raise ModelError(f"{source}: larger than {LARGEST // 1000} kB, too large for a model file; is it the data?")
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > MOST_PARTS:
            keys = BETWEEN.split(QUOTED.sub("", line))
            if max(key.count(".") for key in keys) > MOST_PARTS:
                raise ModelError(f"{source}: a key of more than {MOST_PARTS} parts (at line {number}); mend that line")


def _text(file: Path) -> str:
    """The file's text; what cannot be a model file is refused before it is read whole."""
    if file.is_dir():
        raise ModelError(f"{file}: is a folder; give the model file in it, such as {file / 'model.toml'}")
    if not file.exists():
        raise ModelError(f"{file}: no such file; {_neighbour(file)}")
    if not file.is_file():
        raise ModelError(f"{file}: not an ordinary file; save the model as a text file")
    try:
        with file.open("rb") as handle:
            raw = handle.read(LARGEST + 1)
    except OSError as error:
        raise ModelError(f"{file}: cannot be read ({error.strerror}); check its permissions") from None
    if len(raw) > LARGEST:
        raise ModelError(f"{file.name}: larger than {LARGEST // 1000} kB, too large for a model file; is it the data?")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise ModelError(f"{file.name}: not a text file in UTF-8; save the model as plain text")
    if not text.strip():
        raise ModelError(f'{file.name}: empty; start with a table [states] such as x = "-k*x"')
    return text


def _letters(value: Any) -> int:
    """The characters of all texts in a document."""
    if isinstance(value, dict):
        value = list(value.values())
    return sum(map(_letters, value)) if isinstance(value, list) else len(value) if isinstance(value, str) else 0


def _neighbour(file: Path) -> str:
    try:
        beside = [other.name for other in file.parent.glob("*.toml")]
    except OSError:
        beside = []
    return f"did you mean {file.with_name(beside[0])}?" if len(beside) == 1 else "check the path"


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


class _Reader(Document):
    """Takes a parsed document apart, table by table."""

    def model(self, document: Mapping[str, Any]) -> Model:
        self.known("", document, KEYS)
        tables = {name: self.table(document, name) for name in TABLES}
        listed = document.get("effects", [])
        count = sum(map(len, tables.values())) + (len(listed) if isinstance(listed, list) else 0)
        if count > MOST_ENTRIES:
            raise self.refuse("", f"{count} entries, at most {MOST_ENTRIES} are read", "model a part of the plant")
        letters = _letters([tables["states"], tables["outputs"], listed])
        if letters > MOST_LETTERS:
            what = f"equations of {letters} characters, at most {MOST_LETTERS} are read together"
            raise self.refuse("", what, "model a part of the plant")
        name = document.get("name", self.source.removesuffix(".toml"))
        model = Model(
            name=self.text("name", name, "driven oscillator"),
            time=self.text("time", document["time"], "seconds") if "time" in document else None,
            states={key: self.text(f"[states] {key}", rate, "-k*x") for key, rate in tables["states"].items()},
            parameters={key: self.parameter(key, entry) for key, entry in tables["parameters"].items()},
            inputs={key: self.input(key, entry) for key, entry in tables["inputs"].items()},
            outputs={key: self.output(key, entry) for key, entry in tables["outputs"].items()},
            initial={key: self.start(key, entry) for key, entry in tables["initial"].items()},
            suspect=self.suspect(tables["suspect"]) if "suspect" in document else None,
            units={key: self.text(f"[units] {key}", name, "m") for key, name in tables["units"].items()},
            source=self.source,
        )
        check(model)
        return replace(model, effects=effects(self, document["effects"], model)) if "effects" in document else model

    def table(self, document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
        value = document.get(name, {})
        if not isinstance(value, dict):
            raise self.refuse(
                f"[{name}]", f"expected a table, got {said(value)}", f"write [{name}] on a line of its own"
            )
        return value

    def entry(self, place: str, value: Any, keys: Collection[str]) -> Mapping[str, Any]:
        """The long form of an entry: a table with known keys only."""
        self.known(place, value, keys)
        entry: Mapping[str, Any] = value
        return entry

    def parameter(self, name: str, value: Any) -> Parameter:
        place = f"[parameters] {name}"
        if not isinstance(value, dict):
            return Parameter(self.number(place, value, f"{name} = 1.3"))
        entry = self.entry(place, value, ("value", "sd", "fixed", "free", "unit", "bounds"))
        if "value" not in entry:
            raise self.refuse(place, "no value", f"write {name} = {{ value = 1.3 }}")
        number = self.number(place, entry["value"], "value = 1.3")
        sd = self.positive(place, entry["sd"], "sd") if "sd" in entry else None
        fixed, free = self.flag(place, entry, "fixed"), self.flag(place, entry, "free")
        if free and (fixed or sd is not None):
            other = "fixed" if fixed else "sd"
            raise self.refuse(place, f"free and {other} contradict each other", "keep one of them")
        low, high = self.bounds(place, entry["bounds"]) if "bounds" in entry else (-math.inf, math.inf)
        if not low <= number <= high:
            raise self.refuse(place, f"the value {number:g} is outside its bounds [{low:g}, {high:g}]", "change one")
        unit = self.text(f"{place} unit", entry["unit"], "kg") if "unit" in entry else None
        return Parameter(number, sd, fixed, free, unit, (low, high))

    def bounds(self, place: str, value: Any) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            raise self.refuse(place, f"expected bounds = [low, high], got {said(value)}", "write bounds = [0.0, inf]")
        low, high = (self.number(place, bound, "bounds = [0.0, inf]", finite=False) for bound in value)
        if not low < high:
            raise self.refuse(place, f"bounds [{low:g}, {high:g}] hold nothing", "write the lower one first")
        return low, high

    def input(self, name: str, value: Any) -> Input:
        place = f"[inputs] {name}"
        if not isinstance(value, dict):
            return Input(self.text(place, value, "column name"))
        entry = self.entry(place, value, ("column", "hold", "delay"))
        column = self.text(f"{place} column", entry.get("column", name), "force")
        hold: Hold = entry.get("hold", "previous")
        if hold not in ("previous", "linear"):
            raise self.refuse(place, f"hold is {said(hold)}", 'write hold = "previous" or hold = "linear"')
        delay = self.text(f"{place} delay", entry["delay"], "tau") if "delay" in entry else None
        return Input(column, hold, delay)

    def output(self, name: str, value: Any) -> Output:
        place = f"[outputs] {name}"
        if not isinstance(value, dict):
            return Output(self.text(place, value, "p"), name)
        entry = self.entry(place, value, ("equation", "column", "sigma", "angle"))
        if "equation" not in entry:
            raise self.refuse(place, "no equation", f'write {name} = {{ equation = "p" }}')
        return Output(
            equation=self.text(f"{place} equation", entry["equation"], "p"),
            column=self.text(f"{place} column", entry.get("column", name), "pos"),
            sigma=self.positive(place, entry["sigma"], "sigma") if "sigma" in entry else None,
            angle=self.flag(place, entry, "angle"),
        )

    def start(self, name: str, value: Any) -> Initial:
        place = f"[initial] {name}"
        if not isinstance(value, dict):
            return Initial(self.number(place, value, f"{name} = 0.0"))
        entry = self.entry(place, value, ("value", "estimate"))
        if "value" not in entry:
            raise self.refuse(place, "no value", f"write {name} = {{ value = 0.0, estimate = true }}")
        return Initial(self.number(place, entry["value"], "value = 0.0"), self.flag(place, entry, "estimate"))

    def suspect(self, table: Mapping[str, Any]) -> tuple[str, ...]:
        self.known("[suspect]", table, ("equations",))
        names = table.get("equations")
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise self.refuse("[suspect]", f"expected a list of states, got {said(names)}", 'write equations = ["v"]')
        return tuple(names)
