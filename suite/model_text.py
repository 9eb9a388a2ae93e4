"""A model as the text of its file; short forms where nothing is lost by them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from suite.effect import Effect, Inner
from suite.model import Initial, Input, Model, Output, Parameter

TRIES = Inner("one", 1.0, 0.0, 2.0).tries


def to_toml(model: Model) -> str:
    """The text that `from_toml` reads back to the same model."""
    head = {"name": model.name} | ({"time": model.time} if model.time is not None else {})
    blocks = ["\n".join(_line(key, value) for key, value in head.items())]
    tables: dict[str, Mapping[str, Any]] = {
        "states": model.states,
        "parameters": {name: _parameter(entry) for name, entry in model.parameters.items()},
        "inputs": {name: _input(entry) for name, entry in model.inputs.items()},
        "outputs": {name: _output(name, entry) for name, entry in model.outputs.items()},
        "initial": {name: _initial(entry) for name, entry in model.initial.items()},
        "suspect": {} if model.suspect is None else {"equations": list(model.suspect)},
        "units": model.units,
    }
    for table, entries in tables.items():
        if entries:
            blocks.append("\n".join([f"[{table}]", *(_line(key, value) for key, value in entries.items())]))
    for effect in model.effects:
        blocks.append("\n".join(["[[effects]]", *(_line(key, value) for key, value in _effect(effect).items())]))
    return "\n\n".join(blocks) + "\n"


def _line(key: str, value: Any) -> str:
    """`key = value` on one line; tomli-w writes the atoms, tables stay inline as people write them."""
    import tomli_w

    if isinstance(value, Mapping):
        inner = ", ".join(_line(name, entry) for name, entry in value.items())
        return _line(key, 0).removesuffix("0") + f"{{ {inner} }}"
    if isinstance(value, list):
        return _line(key, 0).removesuffix("0") + f"[{', '.join(_line('k', item)[4:] for item in value)}]"
    return tomli_w.dumps({key: value}).rstrip("\n")


def _parameter(entry: Parameter) -> Any:
    table: dict[str, Any] = {"value": float(entry.value)}
    if entry.sd is not None:
        table["sd"] = float(entry.sd)
    if entry.fixed:
        table["fixed"] = True
    if entry.free:
        table["free"] = True
    if entry.unit is not None:
        table["unit"] = entry.unit
    if entry.bounds != (-math.inf, math.inf):
        table["bounds"] = [float(bound) for bound in entry.bounds]
    return table["value"] if len(table) == 1 else table


def _input(entry: Input) -> Any:
    table = {"column": entry.column}
    if entry.hold != "previous":
        table["hold"] = entry.hold
    if entry.delay is not None:
        table["delay"] = entry.delay
    return entry.column if len(table) == 1 else table


def _output(name: str, entry: Output) -> Any:
    table: dict[str, Any] = {"equation": entry.equation}
    if entry.column != name:
        table["column"] = entry.column
    if entry.sigma is not None:
        table["sigma"] = float(entry.sigma)
    if entry.angle:
        table["angle"] = True
    return entry.equation if len(table) == 1 else table


def _initial(entry: Initial) -> Any:
    return {"value": float(entry.value), "estimate": True} if entry.estimate else float(entry.value)


def _effect(entry: Effect) -> dict[str, Any]:
    """An effect's keys that say more than their defaults."""
    table: dict[str, Any] = {"id": entry.id}
    for item in fields(Effect):
        value = getattr(entry, item.name)
        default = item.default_factory() if item.default_factory is not MISSING else item.default
        if item.name == "id" or value == default or (default is MISSING and not value):
            continue
        match item.name:
            case "inner":
                table["inner"] = {name: _inner(scale) for name, scale in value.items()}
            case "states":
                table["states"] = {
                    name: {"rate": z.rate, "start": z.start, "free": z.free} for name, z in value.items()
                }
            case _:
                table[item.name] = list(value) if isinstance(value, tuple) else value
    return table


def _inner(scale: Inner) -> dict[str, Any]:
    table: dict[str, Any] = {"of": scale.of, "start": scale.start, "low": scale.low, "high": scale.high}
    return table if scale.tries == TRIES else table | {"tries": list(scale.tries)}
