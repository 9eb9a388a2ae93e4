"""What a model's parts may be called, and that each name that is used belongs to something."""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Mapping
from typing import Protocol

from suite import expressions
from suite.errors import ModelError

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}\Z")


class Delayed(Protocol):
    """An input, as far as its names go."""

    @property
    def delay(self) -> str | None: ...


class Named(Protocol):
    """A model, as far as its names go."""

    @property
    def source(self) -> str: ...
    @property
    def states(self) -> Mapping[str, object]: ...
    @property
    def parameters(self) -> Mapping[str, object]: ...
    @property
    def inputs(self) -> Mapping[str, Delayed]: ...
    @property
    def initial(self) -> Mapping[str, object]: ...
    @property
    def suspect(self) -> Collection[str] | None: ...
    @property
    def units(self) -> Mapping[str, object]: ...


def check_names(model: Named) -> None:
    """Raise ModelError at the first name that is no name, is taken, or belongs to nothing."""
    if not model.states:
        raise ModelError(f'{model.source}: no states; add a table [states] with one rate a line, such as x = "-k*x"')
    seen: dict[str, str] = {}
    tables = {"states": model.states, "parameters": model.parameters, "inputs": model.inputs}
    for table, entries in tables.items():
        for name in entries:
            if not NAME.match(name):
                raise ModelError(f"{model.source}, [{table}] {name!r}: a name is letters, digits and _; rename it")
            if name in expressions.RESERVED or keyword.iskeyword(name):
                raise ModelError(f"{model.source}, [{table}] {name}: the name is taken by the language; rename it")
            if name in seen:
                raise ModelError(f"{model.source}, [{table}] {name}: already declared in [{seen[name]}]; rename one")
            seen[name] = table
    for label, named in (("initial", model.initial), ("suspect", model.suspect or ())):
        for name in named:
            if name not in model.states:
                raise ModelError(f"{model.source}, [{label}] {name}: no such state; it has {', '.join(model.states)}")
    for name, entry in model.inputs.items():
        if entry.delay is not None and entry.delay not in model.parameters:
            raise ModelError(
                f"{model.source}, [inputs] {name} delay: {entry.delay!r} is not a parameter; "
                f"add it to [parameters], such as {entry.delay} = 0.1"
            )
    for name in model.units:
        if name not in (*model.states, *model.inputs, expressions.TIME):
            raise ModelError(
                f"{model.source}, [units] {name}: neither a state nor an input nor t; "
                "a parameter's unit stands beside its value"
            )
