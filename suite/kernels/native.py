"""From expressions to LLVM's text: functions that kernels call as they call compiled ones.

Numba's front end takes seconds for what is only arithmetic; here an expression becomes a line or two. One that occurs
again is not computed again, nor is in a gate what the ungated part has computed.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy
from numba.core.datamodel.registry import default_manager

from suite.kernels.lines import Lines
from suite.kernels.types import MODEL, MODEL_FUNCTION

# The arguments of a model's function; the last three are written.
ARGUMENTS = ("t", "x", "u", "p", "on", "value", "by_x", "by_p")


@dataclass(frozen=True)
class Place:
    """An index; one of a state that a gate brings along counts from on[gate]."""

    index: int
    brought: bool = False


@dataclass(frozen=True)
class Target:
    """An element of an argument: x[row], or by_x[row, column]."""

    array: str
    row: Place
    column: Place | None = None


@dataclass(frozen=True)
class Block:
    """What is read, written and added to: always, or (with the number of a gate) where the gate is on."""

    gate: int | None
    read: Mapping[sympy.Symbol, Target]
    added: Mapping[Target, sympy.Expr]
    written: Mapping[Target, sympy.Expr]


def function(name: str, blocks: Sequence[Block]) -> str:
    """The text of a model's function; the ungated block comes first."""
    return _Function(name, blocks).text()


class _Function(Lines):
    """The lines of one function, and the name of each value that is computed already.

    The arguments are numba's own structures of arrays, by value: LLVM then passes them as between two kernels.
    """

    def __init__(self, name: str, blocks: Sequence[Block]) -> None:
        super().__init__()
        self.signature = default_manager.lookup(MODEL.ftype).get_value_type().pointee
        self.name = name
        self.opened = ""  # on[gate] of the gate that is being written
        self.data = {a: self.field(i, "data") for i, a in enumerate(ARGUMENTS) if i}
        self.width = {a: self.field(ARGUMENTS.index(a), "shape", ", 1") for a in ("by_x", "by_p")}
        for block in blocks:
            self.block(block)

    def text(self) -> str:
        head = ", ".join(f"{kind} %{a}" for a, kind in zip(ARGUMENTS, self.signature.args, strict=True))
        result = self.signature.return_type
        first = f"define {result} @{self.name}({head}) nounwind {{\nentry:"
        return "\n".join([first, *self.lines, f"ret {result} zeroinitializer", "}"])

    def field(self, argument: int, name: str, within: str = "") -> str:
        place = default_manager.lookup(MODEL_FUNCTION.args[argument]).get_field_position(name)
        return self.line(f"extractvalue {self.signature.args[argument]} %{ARGUMENTS[argument]}, {place}{within}")

    def block(self, block: Block) -> None:
        known, gate = self.values, block.gate
        if gate is not None:
            self.opened = self.load("i64", self.element(Target("on", Place(gate))))
            active = self.line(f"icmp ne i64 {self.opened}, 0")
            self.lines += [f"br i1 {active}, label %on{gate}, label %off{gate}", f"on{gate}:"]
            self.values = ChainMap({}, known)
        for symbol, source in block.read.items():
            self.values[symbol] = self.load("double", self.element(source))
        for target, expression in block.added.items():
            part, place = self.value(expression), self.element(target)
            self.store(self.line(f"fadd double {self.load('double', place)}, {part}"), place)
        for target, expression in block.written.items():
            self.store(self.value(expression), self.element(target))
        if gate is not None:
            self.lines += [f"br label %off{gate}", f"off{gate}:"]
            self.values = known

    def element(self, target: Target) -> str:
        """A pointer to the element."""
        index = self.index(target.row)
        if target.column is not None:
            index = self.line(f"mul i64 {index}, {self.width[target.array]}")
            index = self.line(f"add i64 {index}, {self.index(target.column)}")
        kind = "i64" if target.array == "on" else "double"
        return self.line(f"getelementptr {kind}, {kind}* {self.data[target.array]}, i64 {index}")

    def index(self, place: Place) -> str:
        return self.line(f"add i64 {self.opened}, {place.index}") if place.brought else str(place.index)
