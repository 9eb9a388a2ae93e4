"""Errors of a model's text: the sentence without the file's name, and the line of the text that it is about."""

from __future__ import annotations

import re

from suite.errors import ModelError
from suite.model import Model
from suite.model_file import from_toml

SOURCE = "model"


class TextError(ModelError):
    """A model's text that cannot be used, with the number of the line, from 1, where that can be told."""

    def __init__(self, sentence: str, line: int | None) -> None:
        super().__init__(sentence)
        self.line = line


def model_of(text: str) -> Model:
    """The model in a text. Raises TextError."""
    if "\0" in text:
        raise TextError("not a text; open a model file, which is plain text", None)
    if not text.strip():
        raise TextError('the model is empty; start with a table [states] such as x = "-k*x"', None)
    try:
        return from_toml(text.removeprefix("\ufeff"), SOURCE)
    except ModelError as error:
        sentence = str(error)
        raise TextError(re.sub(rf"^{SOURCE}(, |: )", "", sentence), line_of(text, sentence)) from None


def line_of(text: str, sentence: str) -> int | None:
    """The line that a sentence of `from_toml` speaks of: where TOML names it, else where the key stands."""
    named = re.search(r"\(at line (\d+)", sentence)
    if named:
        return int(named[1])
    lines = text.splitlines()
    if "(at end of document)" in sentence:
        return max(len(lines), 1)
    place = re.match(rf"{SOURCE}, \[(\[?)(\w+)\]?\](?: (?:number (\d+)|'?([^\s:']+)'?))?(?: (\w+))?", sentence)
    if place is None:
        word = re.match(rf"{SOURCE}(?:, |: )'?(\w+)'?", sentence)
        return (_header(lines, f"[{word[1]}]") or _key(lines, word[1], None)) if word else None
    double, table, number, key, sub = place.groups()
    if double:
        return _effect(lines, table, number, key, sub)
    unknown = re.search(r": '(\w+)' is not known here", sentence)
    found = _key(lines, key or (unknown[1] if unknown else ""), table)
    return found or _header(lines, f"[{table}]")


def _key(lines: list[str], key: str, table: str | None) -> int | None:
    """The line `key = ...` of a table, or `table.key = ...`, or where the table is on one line that line."""
    if not key:
        return None
    now: str | None = None
    quoted = rf"[\"']?{re.escape(key)}[\"']?"
    for number, line in enumerate(lines, 1):
        header = re.match(r"\s*\[+\s*([\w.]+)\s*\]+", line)
        if header:
            now = header[1]
        elif (
            (now == table and re.match(rf"\s*{quoted}\s*=", line))
            or (now is None and table and re.match(rf"\s*{table}\.{quoted}\s*=", line))
            or (now is None and table and re.match(rf"\s*{table}\s*=.*(?<!\w){quoted}\s*=", line))
        ):
            return number
        if header and table and header[1] == f"{table}.{key}":
            return number
    return None


def _header(lines: list[str], header: str) -> int | None:
    """The line of a table's header, `[table]` or `[[table]]`."""
    plain = [line.replace(" ", "").removeprefix("[") for line in lines]
    return next((number for number, line in enumerate(plain, 1) if line.startswith(header.removeprefix("["))), None)


def _effect(lines: list[str], table: str, number: str | None, key: str | None, sub: str | None) -> int | None:
    """In the list of own effects: the n-th header, or the id's line, or a key's line of that effect."""
    starts = [k for k, line in enumerate(lines) if line.replace(" ", "").startswith(f"[[{table}]]")]
    for count, first in enumerate(starts, 1):
        last = starts[count] if count < len(starts) else len(lines)
        own = lines[first:last]
        at = next((k for k, line in enumerate(own) if re.match(rf"\s*id\s*=\s*[\"']{key}[\"']", line)), None)
        if number is not None and int(number) == count:
            return first + 1
        if key is not None and at is not None:
            inside = next((k for k, line in enumerate(own) if sub and re.match(rf"\s*{sub}\s*=", line)), at)
            return first + inside + 1
    return starts[0] + 1 if starts else None
