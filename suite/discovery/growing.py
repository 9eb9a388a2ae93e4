"""A model with effects added: its equations, and what is new in it under names that are free."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from suite import expressions
from suite.discovery.term_units import brought
from suite.discovery.terms import Term, renamed
from suite.model import Hold, Initial, Model, Parameter


def grown(model: Model, terms: Sequence[Term], numbers: Sequence[Mapping[str, Parameter]]) -> Model:
    """The model with the terms added, their parameters and first values as in `numbers` under names that are free.

    Where the model has units, what is new has its unit too.
    """
    units = [brought(term, model) for term in terms]
    for term, at, unit in zip(terms, numbers, units, strict=True):
        names = _free(model, [*term.names, *term.states])
        parameters = {names[n]: replace(at[n], unit=at[n].unit or unit[n]) for n in term.stated}
        if re.search(r"__(late|held)\b", term.text):
            entry = model.inputs[term.symbol]
            held: Hold = "linear" if entry.hold == "previous" else "previous"
            late = "__late" in term.text
            model = model.with_input(
                term.symbol,
                parameters,
                delay=names[term.stated[0]] if late else None,
                hold=entry.hold if late else held,
            )
            continue
        text = _one(term, renamed(term.text, names))
        states = {names[z]: renamed(rate, names) for z, (rate, _, _) in term.states.items()}
        initial = {names[z]: Initial(at[z].value, estimate=free) for z, (_, _, free) in term.states.items()}
        target = term.equation if term.place in ("rate", "output") else term.symbol
        model = model.plus(target, text, parameters, states, initial, measured=term.place == "output")
        model = model.plus(term.source, _opposite(text)) if term.source else model
        known = {names[z]: said for z in term.states if (said := unit[z])}
        model = replace(model, units={**model.units, **known}) if known else model
    return model


def _free(model: Model, wanted: Sequence[str]) -> dict[str, str]:
    """Names that the model does not have yet, one for each that is wanted."""
    taken = set(model.states) | set(model.parameters) | set(model.inputs) | set(expressions.RESERVED)
    free = {}
    for name in wanted:
        stem, number = re.sub(r"_\d+\Z", "", name), 0
        fresh = name if name not in taken else stem
        while fresh in taken:
            number += 1
            fresh = f"{stem}_{number}"
        taken.add(fresh)
        free[name] = fresh
    return free


def _one(term: Term, text: str) -> str:
    """The text with a pinned coefficient left out."""
    return re.sub(rf"\b{term.coefficients[0]}\*", "", text) if term.effect.pinned else text


def _opposite(text: str) -> str:
    """The text, which opens with its sign, with the other sign."""
    inner = text[1:].strip()
    product = re.fullmatch(r"[\w.*]+", inner) is not None
    return f"{'-' if text[0] == '+' else '+'}{inner if product else f'({inner})'}"
