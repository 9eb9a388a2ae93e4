"""The page of all effects: where each acts, its term, its numbers, its physics and its picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from suite.effect import Added, Effect, Inner
from suite.errors import ModelError
from suite.files import write_whole
from suite.report.effect_figures import effect_figure
from suite.report.effect_trace import place
from suite.report.figures import plain
from suite.report.vector import svg

HEADINGS = {
    "mechanical": "In the rate of a speed",
    "state": "In the rate of a state that has no position",
    "any": "In any rate",
    "output": "In a measurement",
    "input": "In an input",
    "parameter": "In a parameter",
    "clock": "In the clock",
    "named": "In one equation of one model",
}
OF = {
    "spread": "the visited range of the variable, from zero",
    "range": "the visited range, 0 its low end, 1 its high end",
    "frequency": "one period a record", "time": "the record's length", "step": "one sample", "one": "the number itself",
}  # fmt: skip
OPENING = """# The effects

What a model may lack: the library that `diagnose` and `discover` search. A name in a term is a *letter* that stands for
what plays a role in your model, a coefficient (`a`, `b`: unknown, zero where the effect is absent), an inner scale
(`w`, `s`: an unknown width, place, time or power within a function) or a state that the effect brings (`z`). Terms open
with their sign: a positive coefficient is the physical direction.

The pictures show a typical motion and what the term adds along it. Coefficients are 1, inner scales stand as written
above the curve; scales of axes mean nothing. Grey is the motion, or what would be without the effect; blue is what the
rate lacks, d; orange is what the sensor, input, parameter or clock becomes. The report of `discover` draws the same
for your data: d against its variable with the fitted term over it.

A model file may hold effects of its own: see [the model file](model-file.md#effects).

Made by `unmodelled list --effects docs`.
"""


def write(effects: Mapping[str, Effect], folder: Path) -> list[Path]:
    """Write effects.md and effects/ID.svg to a folder; the paths written, the page last."""
    paths: list[Path] = []
    groups: dict[str, list[str]] = {group: [] for group in HEADINGS}
    rows = []
    for name, effect in sorted(effects.items()):
        picture = folder / "effects" / f"{name}.svg"
        try:
            write_whole(picture, svg(effect_figure(effect), name) + "\n")
            paths.append(picture)
            drawn = f'<img src="effects/{name}.svg" width="640" alt="{plain(name)}: what it adds">'
        except ModelError as error:
            drawn = f"No picture: {error}."
        groups[_group(effect)].append(f"### {name}\n\n{said(effect)}\n\n{drawn}")
        rows.append(f"| [{name}](#{name}) | {HEADINGS[_group(effect)].removeprefix('In ')} | `{effect.term}` |")
    table = "\n".join(["| Effect | Acts in | Term |", "|---|---|---|", *rows])
    parts = [OPENING + "\n" + table]
    for group, entries in groups.items():
        if entries:
            parts.append("\n\n".join([f"## {HEADINGS[group]}", *entries]))
    write_whole(folder / "effects.md", "\n\n".join(parts) + "\n")
    return [*paths, folder / "effects.md"]


def said(effect: Effect) -> str:
    """The effect in Markdown: its sentence, then a list of what its text says."""
    lines = [effect.sentence, "", f"- Term: `{effect.term}`" + "".join(f", or `{form}`" for form in effect.forms)]
    lines.append(f"- Acts on: {where(effect)}")
    lines += [f"- Brings the state `{z}`: {added(z, entry)}" for z, entry in effect.states.items()]
    lines += [f"- Inner scale `{name}`: {scale(inner)}" for name, inner in effect.inner.items()]
    names = " and ".join(f"`{name}`" for name in effect.coefficients)
    number = f"dimension {effect.dimension}" if effect.dimension else "of no stated dimension"
    if effect.pinned:
        lines.append(f"- Coefficient {names}: exactly 1 where the effect is there")
    elif effect.sign:
        lines.append(f"- Coefficient {names}: cannot be negative; {number}")
    else:
        lines.append(f"- Coefficient {names}: either sign; {number}")
    if effect.family:
        lines.append(f"- Family: {effect.family}")
    if effect.generic:
        lines.append("- A shape rather than physics: it gives way to an effect of the same shape")
    return "\n".join(lines)


def where(effect: Effect) -> str:
    """The roles in a sentence, with their letters."""
    if effect.equation:
        return f"`{effect.equation}`, in the model's own names"
    words = {
        "position": "the position `{}`", "angle": "the position `{}`, an angle",
        "rate": "a speed `{}`, in whose rate it acts",
        "state": "a state `{}` without position, in whose rate it acts",
        "content": "a state `{}` that is no temperature and has no position, in whose rate it acts",
        "any": "a state `{}`, in whose rate it acts", "other": "another state `{}`", "another": "a third state `{}`",
        "source": "another state `{}`, whose rate loses the same, where the model already moves something between them",
        "deviation": "its deviation `{}` from the level that it relaxes to (itself where there is none)",
        "temperature": "its absolute temperature `{}`", "level": "the ambient's absolute temperature `{}`",
        "output": "an output `{}`", "input": "an input `{}`", "late": "the input one coefficient earlier, `{}`",
        "held": "the input held the other way between samples, `{}`", "parameter": "a parameter `{}`",
        "fixed": "a parameter `{}` that the file says is exact", "clock": "every rate `{}`",
    }  # fmt: skip
    order = list(words)
    ranked = sorted(effect.roles.items(), key=lambda item: order.index(item[1]) if item[1] in order else len(order))
    return "; ".join(words.get(role, role + " `{}`").format(letter) for letter, role in ranked)


def scale(inner: Inner) -> str:
    """An inner scale's start and range in words."""
    return f"starts at {inner.start:g}, from {inner.low:g} to {inner.high:g}, in units of {OF[inner.of]}"


def added(name: str, entry: Added) -> str:
    """A state that the effect brings: its rate and first value."""
    first = f"estimated, from `{entry.start}`" if entry.free else f"`{entry.start}`"
    return f"`{name}' = {entry.rate}`, at first {first}"


def _group(effect: Effect) -> str:
    if effect.equation:
        return "named"
    roles = set(effect.roles.values())
    spot = place(effect)
    if spot != "rate":
        return "parameter" if spot == "fixed" else spot
    if roles & {"rate", "position", "angle"}:
        return "mechanical"
    return "any" if "any" in roles else "state"
