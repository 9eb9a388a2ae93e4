"""From effects to candidates: which terms could be missing in this model, given the roles its parts play.

Roles are read off the equations. p' = v makes p a position and v its rate. A state whose rate depends on it only
through (x - A), A a parameter or an input, deviates from the level A. A state is a temperature if its name or the
unit of its level says so. Outputs, inputs, parameters and the clock have the effects that act in them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import sympy

from suite import expressions
from suite.discovery import roles
from suite.discovery.terms import Place, Term
from suite.effect import Effect
from suite.model import Model
from suite.names import NAME
from suite.record import Record

MANY_STATES = 12  # above which a coupling is tried between states that an equation connects already
FEW_STATES = 4  # up to which any three states are tried together
SPEED = re.compile(r"(v|vx|vy|vz|w|omega|speed)\d*\Z")  # names of speeds whose position is no state
# Roles of everything that is no state; they say where the effect acts.
ELSEWHERE: Mapping[str, Place] = {
    "output": "output", "input": "input", "parameter": "parameter", "fixed": "parameter", "clock": "clock",
}  # fmt: skip


def candidates(
    model: Model, effects: Mapping[str, Effect], absolute: bool = False, record: Record | None = None
) -> tuple[Term, ...]:
    """Every effect wherever its roles are played: in the suspect equations, and in measurements, inputs, parameters.

    The model's symmetries are kept: where no equation depends on a state's absolute value (height in free fall), no
    candidate of a rate may either, unless `absolute`, or unless its zero means something: a store's, which others fill,
    or that of a state which the `record` shows going to and fro about it. Of two candidates of the same shape in one
    equation the first stays, physics before a generic stand-in. The model's own effects come first; one that names its
    equation acts there whatever is suspect.
    """
    effects = {effect.id: effect for effect in model.effects} | dict(effects)
    used = set().union(*(rate.free_symbols for rate in model.rates))
    centred = roles.centred(model, record) if record is not None else set()
    stores = {s for s in model.states if roles.sources(model, s)}
    hidden = set() if absolute else {s for s in model.states if expressions.symbol(s) not in used} - centred - stores
    names = Names(model)
    found: dict[tuple[str, str, sympy.Expr], Term] = {}
    for term in _where_it_says(model, names):
        shape = _shape(term, names)
        found[(term.equation, "", shape if _positive(shape) else -shape)] = term
    for equation in model.suspects:
        level = roles.level(model, equation)
        own = [term for effect in effects.values() for term in _in_rate(model, effect, equation, level, names)]
        for term in sorted(own, key=lambda term: term.effect.generic):
            shape = _shape(term, names)
            texts = [term.text, *(z[0] for z in term.states.values())]
            if not hidden & set().union(*map(_words, texts)):
                found.setdefault((equation, term.source, shape if _positive(shape) else -shape), term)
    elsewhere = [term for effect in effects.values() for term in _elsewhere(model, effect, names)]
    return (*found.values(), *elsewhere)


def _shape(term: Term, names: Names) -> sympy.Expr:
    """The term with its parameters numbered, so that equal shapes are equal; states that it brings belong to it."""
    own = set(term.names) | set(term.states)
    shape = expressions.parse(term.text, names.all | own, f"effect {term.effect.id}")
    numbered = {expressions.symbol(name): sympy.Symbol(f"c{i}") for i, name in enumerate(term.names)}
    brought = {expressions.symbol(z): sympy.Symbol(f"{term.effect.id}_{z}") for z in term.states}
    return shape.subs(list((numbered | brought).items()))


def _positive(shape: sympy.Expr) -> bool:
    return not shape.could_extract_minus_sign()


@dataclass(frozen=True)
class Names:
    """Names that collide with nothing in a model."""

    model: Model
    all: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        model = self.model
        object.__setattr__(self, "all", frozenset(model.states) | set(model.parameters) | set(model.inputs))

    def fresh(self, wanted: str) -> str:
        """`wanted`, or with the first free number behind it."""
        taken = self.all | expressions.RESERVED
        if wanted not in taken:
            return wanted
        number = 1
        while f"{wanted}_{number}" in taken:
            number += 1
        return f"{wanted}_{number}"


def _where_it_says(model: Model, names: Names) -> Iterator[Term]:
    """The model's own effects that name their equation, in the model's own names."""
    for effect in (effect for effect in model.effects if effect.equation):
        target = effect.equation
        place: Place = "rate" if target in model.states else "output" if target in model.outputs else "input"
        own = {*effect.coefficients, *effect.inner, *effect.states}
        for form in (effect.term, *effect.forms):
            # What stands in a bracket with an inner scale is what that is a scale of.
            beside = set().union(*(_words(b) for b in re.findall(r"\(([^()]*)\)", form) if _words(b) & {*effect.inner}))
            used = [n for n in (target, *model.states, *model.inputs, expressions.TIME) if n in _words(form) - own]
            variable = next(iter([n for n in used if n in beside] + used), target)
            yield _bound(effect, form, place, target, "" if place == "rate" else target, {}, variable, names)


def _in_rate(model: Model, effect: Effect, equation: str, level: str | None, names: Names) -> Iterator[Term]:
    """The effect with its role letters replaced by the states that play them in this equation."""
    position = next((p for p in model.definitions if model.states[p].strip() == equation), None)
    wanted = set(effect.roles.values())
    if wanted & set(ELSEWHERE) or effect.equation:
        return
    mechanical = position is not None
    if wanted & {"position", "angle"} and not mechanical:
        return
    if "rate" in wanted and not (mechanical or SPEED.match(equation)):
        return
    if "angle" in wanted and not roles.is_angle(model, position or ""):
        return
    if wanted & {"state", "content"} and mechanical:
        return
    deviation = f"({equation} - {level})" if level else equation
    kelvin = roles.kelvin(model, equation, level)
    if "content" in wanted and kelvin is not None:
        return
    if wanted & {"temperature", "level"} and (kelvin is None or ("level" in wanted and level is None)):
        return
    offset = f" + {kelvin:g}" if kelvin else ""
    own = {position, equation} if mechanical else {equation}
    others = [s for s in model.states if s not in own] if "other" in wanted else [""]
    if "other" in wanted and effect.id == "product_coupling":
        others = [s for s in model.states if s != equation]
    if "other" in wanted and len(model.states) > MANY_STATES:
        connected = roles.connected(model, equation)
        others = [s for s in others if s in connected]
    if "source" in wanted:
        others = [s for s in roles.sources(model, equation) if s in model.suspects]
    small = len(model.states) <= FEW_STATES
    both = [(other, next((s for s in model.states if s not in (equation, other)), "")) for other in others]
    if "another" in wanted and small:
        both = [(o, s) for o in others for s in model.states if s not in (equation, o)] or both
    for other, another in both:
        filled = {
            "position": position or "",
            "angle": position or "",
            "rate": equation,
            "state": equation,
            "content": equation,
            "any": equation,
            "other": other,
            "source": other,
            "another": another,
            "deviation": deviation,
            "temperature": f"({equation}{offset})",
            "level": f"({level}{offset})",
        }
        letters = {letter: filled[role] for letter, role in effect.roles.items()}
        variable = other or (position if wanted & {"position", "angle"} and position else equation)
        for form in (effect.term, *effect.forms):
            third = [letter for letter, role in effect.roles.items() if role == "another" and letter in _words(form)]
            if third and not (small and another):
                continue
            yield _bound(
                effect, form, "rate", equation, "", letters, variable, names, other if "source" in wanted else ""
            )


def _elsewhere(model: Model, effect: Effect, names: Names) -> Iterator[Term]:
    """The effect in every measurement, input or parameter that it could act in, or in the clock."""
    role, letter = next(((r, lt) for lt, r in effect.roles.items() if r in ELSEWHERE), ("", ""))
    forms = (effect.term, *effect.forms)
    if role == "output":
        for name, output in model.outputs.items():
            letters = {letter: output.equation if NAME.match(output.equation) else f"({output.equation})"}
            for form in forms if not (output.angle and letter in _words(effect.term)) else ():
                yield _bound(effect, form, "output", name, name, letters, name, names)
    elif role == "input":
        for name, entry in model.inputs.items():
            if entry.delay is None or not set(effect.roles.values()) & {"late", "held"}:
                letters = {letter: name}
                letters |= {lt: f"{name}__{r}" for lt, r in effect.roles.items() if r in ("late", "held")}
                for form in forms:
                    yield _bound(effect, form, "input", name, name, letters, name, names)
    elif role in ("parameter", "fixed"):
        for name, parameter in model.parameters.items():
            where = roles.stands_in(model, name)
            if where and parameter.value != 0 and (role == "parameter" or parameter.fixed):
                for form in forms:
                    yield _bound(effect, form, "parameter", where, name, {letter: name}, name, names)
    elif role == "clock":
        for form in forms:
            yield _bound(effect, form, "clock", "t", "t", {letter: "1"}, "t", names)


def _bound(
    effect: Effect, form: str, place: Place, equation: str, symbol: str, letters: Mapping[str, str], variable: str,
    names: Names, source: str = "",
) -> Term:  # fmt: skip
    """A candidate: the effect's text with its letters replaced, its parameters and states under names of their own."""
    fresh = {name: names.fresh(name) for name in (*effect.coefficients, *effect.inner, *effect.states)}

    def written(text: str) -> str:
        return re.sub(r"abs\(\(([^()]*)\)\)", r"abs(\1)", renamed(text, {**letters, **fresh}))

    return Term(
        effect,
        equation,
        written(form),
        tuple(fresh[name] for name in effect.coefficients),
        {fresh[name]: inner for name, inner in effect.inner.items()},
        variable,
        place,
        symbol,
        {fresh[name]: (written(z.rate), written(z.start), z.free) for name, z in effect.states.items()},
        source,
    )


def renamed(text: str, names: Mapping[str, str]) -> str:
    """The text with its names replaced."""
    return re.sub(r"[A-Za-z_]\w*", lambda match: names.get(match.group(), match.group()), text)


def _words(text: str) -> set[str]:
    return set(re.findall(r"[A-Za-z_]\w*", text))


def triage(term: Term) -> bool:
    """Whether a candidate acts outside the equations of motion: in a sensor, an input, a number or the clock."""
    return term.place != "rate"


def incompatible(first: Term, second: Term) -> bool:
    """Whether two candidates may not stand together: a gain of an input beside one of a sensor scales the same thing,
    and an input, a parameter or a sensor is changed once.
    """
    places = {first.place, second.place}
    scales = {first.effect.id, second.effect.id}
    same = first.place == second.place and triage(first) and first.symbol == second.symbol
    return same or (places == {"input", "output"} and scales <= {"missing_input_gain", "sensor_scale"})
