"""The `[[effects]]` tables of a model file: a user's own effects, each checked before anything is searched."""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, get_args

from suite import expressions
from suite.document import Document, said
from suite.effect import Added, Effect, Inner, Role
from suite.model import Model
from suite.names import NAME

KEYS = (
    "id", "term", "roles", "equation", "sentence", "coefficients", "sign", "inner", "states", "forms", "pinned",
    "dimension", "family", "generic", "law", "least",
)  # fmt: skip
ROLES = get_args(Role)
OUTSIDE = ("output", "input", "late", "held", "parameter", "fixed", "clock")  # roles of what is no rate
SCALES = ("spread", "range", "frequency", "time", "step", "one")


def effects(document: Document, tables: Any, model: Model) -> tuple[Effect, ...]:
    """The effects of a model file. Raises ModelError: one sentence with the effect, what came and the mend."""
    from suite import plugins

    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise document.refuse("[[effects]]", f"expected tables, got {said(tables)}", "write [[effects]] above each")
    found: dict[str, Effect] = {}
    for number, table in enumerate(tables):
        effect = _Table(document, table, model, number).effect()
        place = f"[[effects]] {effect.id}"
        if effect.id in found:
            raise document.refuse(place, "the id is given twice", "rename one")
        if effect.id in plugins.effects():
            raise document.refuse(place, "the library has an effect of this id", "rename yours")
        found[effect.id] = effect
    return tuple(found.values())


class _Table:
    """One table, taken apart."""

    def __init__(self, document: Document, table: Mapping[str, Any], model: Model, number: int) -> None:
        self.document, self.table, self.model = document, table, model
        self.place = f"[[effects]] number {number + 1}"
        if "id" not in table:
            raise self.refuse("", "no id", 'write id = "magnet"')
        name = document.text(f"{self.place} id", table["id"], "magnet")
        if not NAME.match(name):
            raise self.refuse("id", f"{said(name)} is no name", "use letters, digits and _")
        self.place = f"[[effects]] {name}"
        self.name = name

    def refuse(self, key: str, what: str, mend: str) -> Exception:
        return self.document.refuse(f"{self.place} {key}".strip(), what, mend)

    def effect(self) -> Effect:
        table, document = self.table, self.document
        document.known(self.place, table, KEYS)
        if "term" not in table:
            raise self.refuse("", "no term", 'write term = "-a*p**3"')
        coefficients = self.texts("coefficients", table.get("coefficients", ["a"]), '["a"]')
        if not coefficients:
            raise self.refuse("coefficients", "the list is empty", 'write coefficients = ["a"]')
        roles, equation = self.roles(), self.equation()
        inner = {name: self.inner(name, entry) for name, entry in self.entries("inner").items()}
        states = {name: self.state(name, entry) for name, entry in self.entries("states").items()}
        own = (*coefficients, *inner, *states)
        self.names((*own, *roles))
        letters = {*roles} if roles else {*self.model.states, *self.model.parameters, *self.model.inputs}
        known = letters | set(own)
        term = self.equation_text("term", table["term"], known)
        forms = self.texts("forms", table.get("forms", []), '["+a*p**3"]')
        rates = [text for z in states.values() for text in (z.rate, z.start)]
        for key, text in [*(("forms", f) for f in forms), *((f"states {z}", x) for z in states for x in rates)]:
            self.equation_text(key, text, known)
        used = _words(" ".join([term, *rates]))
        for name in own if "late" not in roles.values() else ():
            if name not in used:
                raise self.refuse("", f"{name} stands nowhere in the term", f"use {name} in it, or leave {name} out")
        if "late" not in roles.values():
            self.vanishes(term, coefficients, known)
        sign = table.get("sign", 0)
        if isinstance(sign, bool) or sign not in (0, 1):
            raise self.refuse(
                "sign", f"expected 0 or 1, got {said(sign)}", "write 1 for a coefficient that is positive"
            )
        return Effect(
            id=self.name,
            term=_signed(term),
            roles=roles,
            sentence=self.words("sentence"),
            dimension=self.words("dimension"),
            coefficients=coefficients,
            sign=1 if sign == 1 else 0,
            inner=inner,
            states=states,
            forms=tuple(map(_signed, forms)),
            pinned=document.flag(self.place, table, "pinned"),
            family=self.words("family"),
            generic=document.flag(self.place, table, "generic"),
            equation=equation,
            law=self.words("law"),
            least=document.number(f"{self.place} least", table["least"], "least = -1.0")
            if "least" in table
            else -math.inf,
        )

    def vanishes(self, term: str, coefficients: Sequence[str], known: Collection[str]) -> None:
        """Without its coefficients an effect is not there: the search starts from zero."""
        without = expressions.parse(term, known, self.place).subs({expressions.symbol(c): 0 for c in coefficients})
        if without.expand() != 0:
            left = expressions.plain(without)
            zero = " and ".join(f"{c} = 0" for c in coefficients)
            raise self.refuse("term", f"with {zero} it leaves {left}", "multiply each part by a coefficient")

    def roles(self) -> dict[str, str]:
        """Letter -> role; none where the effect says its equation."""
        table = self.table
        if ("roles" in table) == ("equation" in table):
            what = "both roles and equation" if "roles" in table else "neither roles nor equation"
            raise self.refuse("", what, 'write roles = { p = "position" }, or equation = "v" with the model\'s names')
        roles = self.entries("roles")
        for letter, role in roles.items():
            if role not in ROLES:
                raise self.refuse(f"roles {letter}", f"{said(role)} is no role", f"choose one of {', '.join(ROLES)}")
        if "equation" not in table and not roles:
            raise self.refuse("roles", "no role", 'write one such as roles = { p = "position" }')
        outside = [role for role in roles.values() if role in OUTSIDE]
        if outside and not set(roles.values()) <= {outside[0], "input", "late", "held"}:
            other = next(role for role in roles.values() if role != outside[0])
            raise self.refuse("roles", f"{outside[0]} and {other} do not go together", "an effect acts in one place")
        if {"late", "held"} & set(outside) and "input" not in outside:
            raise self.refuse("roles", f"{outside[0]} needs an input", 'add one such as u = "input"')
        return dict(roles)

    def equation(self) -> str:
        """The state, output or input that the effect acts in, where it says so itself."""
        if "equation" not in self.table:
            return ""
        name = self.document.text(f"{self.place} equation", self.table["equation"], "v")
        places = (*self.model.states, *self.model.outputs, *self.model.inputs)
        if name not in places:
            raise self.refuse("equation", f"the model has no {said(name)}", f"choose one of {', '.join(places)}")
        return name

    def inner(self, name: str, entry: Any) -> Inner:
        """One inner scale: what it is a multiple of, where it starts and its range."""
        document, place = self.document, f"{self.place} inner {name}"
        example = '{ of = "spread", start = 0.1, low = 0.01, high = 1.0 }'
        if not isinstance(entry, dict) or not {"of", "start", "low", "high"} <= entry.keys():
            raise self.refuse(f"inner {name}", "it needs of, start, low and high", f"write {name} = {example}")
        document.known(place, entry, ("of", "start", "low", "high", "tries"))
        if entry["of"] not in SCALES:
            raise self.refuse(f"inner {name}", f"of is {said(entry['of'])}", f"choose one of {', '.join(SCALES)}")
        start, low, high = (document.number(place, entry[key], f"{key} = 0.1") for key in ("start", "low", "high"))
        if not low <= start <= high:
            raise self.refuse(
                f"inner {name}",
                f"start {start:g} with low {low:g} and high {high:g}",
                "order them: low <= start <= high",
            )
        if low <= 0 and entry["of"] not in ("range", "one"):
            raise self.refuse(f"inner {name}", f"low is {low:g}", "a scale is positive: write low = 0.01")
        if "tries" not in entry:
            return Inner(entry["of"], start, low, high)
        tries = entry["tries"]
        if not isinstance(tries, list) or not tries:
            raise self.refuse(f"inner {name}", f"tries is {said(tries)}", "write tries = [1.0, 0.3, 3.0]")
        return Inner(
            entry["of"], start, low, high, tuple(document.number(place, x, "tries = [1.0, 0.3, 3.0]") for x in tries)
        )

    def state(self, name: str, entry: Any) -> Added:
        """One added state: its rate, its first value, and whether that is estimated."""
        place = f"{self.place} states {name}"
        if not isinstance(entry, dict) or "rate" not in entry:
            raise self.refuse(f"states {name}", "no rate", f'write {name} = {{ rate = "(v - {name})/w" }}')
        self.document.known(place, entry, ("rate", "start", "free"))
        rate = self.document.text(f"{place} rate", entry["rate"], "(v - z)/w")
        start = self.document.text(f"{place} start", entry.get("start", "0"), "0")
        return Added(rate, start, self.document.flag(place, entry, "free"))

    def entries(self, key: str) -> Mapping[str, Any]:
        value = self.table.get(key, {})
        if not isinstance(value, dict):
            raise self.refuse(key, f"expected a table, got {said(value)}", f"write {key} = {{ ... }}")
        return value

    def texts(self, key: str, value: Any, example: str) -> tuple[str, ...]:
        if not isinstance(value, list) or not all(isinstance(text, str) and text.strip() for text in value):
            raise self.refuse(key, f"expected a list of texts, got {said(value)}", f"write {key} = {example}")
        return tuple(value)

    def words(self, key: str) -> str:
        return self.document.text(f"{self.place} {key}", self.table[key], "...") if key in self.table else ""

    def names(self, names: Sequence[str]) -> None:
        """Each name is one, and belongs to one thing."""
        for name in names:
            if not NAME.match(name) or name in expressions.RESERVED or keyword.iskeyword(name):
                raise self.refuse(
                    "", f"{said(name)} cannot be a name here", "use letters that the language leaves free"
                )
            if names.count(name) > 1:
                raise self.refuse("", f"{name} is two things at once", "rename one")

    def equation_text(self, key: str, value: Any, known: Collection[str]) -> str:
        """A text in known names only, that can be parsed."""
        text = self.document.text(f"{self.place} {key}", value, "-a*p**3")
        for name in sorted(_words(text) - set(known) - expressions.RESERVED):
            places = "coefficients, inner or states"
            mend = (
                f"add it to roles, {places}, or use the model's own names with equation in place of roles"
                if "roles" in self.table
                else f"add it to {places}, or declare it in the model"
            )
            raise self.refuse(key, f"{name!r} is not declared", mend)
        expressions.parse(text, known, f"{self.document.source}, {self.place} {key}")
        return text


def _words(text: str) -> set[str]:
    """The names in a text; the e of 1e-3 is none."""
    return set(re.findall(r"(?<![\w.])[A-Za-z_]\w*", text))


def _signed(term: str) -> str:
    """The term as the contract has it: opening with its sign."""
    text = term.strip()
    return text if text[:1] in ("+", "-") else f"+{text}"
