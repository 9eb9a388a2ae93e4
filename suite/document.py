"""A parsed document and its pieces: each taken with its kind checked, or refused in one sentence."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from suite.errors import ModelError


@dataclass(frozen=True)
class Document:
    """Checks of single values; `source` is the file's name in sentences."""

    source: str

    def refuse(self, table: str, what: str, mend: str) -> ModelError:
        """The error of one value: where, what came, and the mend."""
        place = f", {table}" if table else ""
        return ModelError(f"{self.source}{place}: {what}; {mend}")

    def known(self, place: str, given: Collection[str], keys: Collection[str]) -> None:
        """Refuse keys outside the known ones, with the closest of them."""
        for key in given:
            if key not in keys:
                close = difflib.get_close_matches(key.lower(), keys, n=1, cutoff=0.6)
                hint = f" (did you mean {close[0]}?)" if close else ""
                raise self.refuse(place, f"{key!r} is not known here{hint}", f"known are {', '.join(keys)}")

    def number(self, place: str, value: Any, example: str, *, finite: bool = True) -> float:
        """A finite number (or, asked for, an infinite one); true and false are none."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refuse(place, f"expected a number, got {said(value)}", f"write {example}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isnan(number) or (finite and math.isinf(number)):
            raise self.refuse(place, f"expected a finite number, got {number}", f"write {example}")
        return number

    def positive(self, place: str, value: Any, key: str) -> float:
        """A number above zero."""
        number = self.number(place, value, f"{key} = 0.1")
        if number <= 0.0:
            exact = "; an exact number is fixed = true" if key == "sd" else ""
            raise self.refuse(place, f"{key} is {number:g}, expected a number above 0", f"write {key} = 0.1{exact}")
        return number

    def text(self, place: str, value: Any, example: str) -> str:
        """A text that says something."""
        if not isinstance(value, str):
            key = place.rpartition(" ")[2]
            raise self.refuse(place, f"expected text in quotes, got {said(value)}", f'write {key} = "{example}"')
        if not value.strip():
            raise self.refuse(place, "the text is empty", f'write something such as "{example}"')
        return value

    def flag(self, place: str, entry: Mapping[str, Any], key: str) -> bool:
        """True or false, false where left out."""
        value = entry.get(key, False)
        if not isinstance(value, bool):
            raise self.refuse(place, f"{key} is {said(value)}, expected true or false", f"write {key} = true")
        return value


def said(value: Any) -> str:
    """A value as a sentence shows it: as TOML says it, and short."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return "a list"
    shown = repr(value) if not isinstance(value, int) or abs(value) < 10**30 else "a very long number"
    return shown if len(shown) <= 60 else shown[:57] + "..."
