"""From expressions to LLVM's text: functions that kernels call as they call compiled ones.

Numba's front end takes seconds for what is only arithmetic; here an expression becomes a line or two. One that occurs
again is not computed again, nor is in a gate what the ungated part has computed.
"""

from __future__ import annotations

import struct
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import sympy
from numba.core.datamodel.registry import default_manager

from suite.kernels.types import MODEL, MODEL_FUNCTION

# The arguments of a model's function; the last three are written.
ARGUMENTS = ("t", "x", "u", "p", "on", "value", "by_x", "by_p")
LONGEST_CHAIN = 64  # whole powers up to here are chains of products

INTRINSICS = {name: f"llvm.{name}.f64" for name in ("sin", "cos", "exp", "log", "sqrt", "fabs", "pow")}
LIBRARY = {name: name for name in ("tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")}
CALLED = INTRINSICS | LIBRARY
WITH_TWO = ("pow", "atan2")


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


def module(functions: Mapping[str, Sequence[Block]]) -> str:
    """The text of a module with the named functions; the ungated block comes first."""
    declared = [
        f"declare double @{callee}({', '.join(['double'] * (2 if name in WITH_TWO else 1))})"
        for name, callee in CALLED.items()
    ]
    return "\n".join([*declared, *(_Function(name, blocks).text() for name, blocks in functions.items()), ""])


def _number(value: float) -> str:
    return f"0x{struct.pack('>d', value).hex().upper()}"


class _Function:
    """The lines of one function, and the name of each value that is computed already.

    The arguments are numba's own structures of arrays, by value: LLVM then passes them as between two kernels.
    """

    def __init__(self, name: str, blocks: Sequence[Block]) -> None:
        self.signature = default_manager.lookup(MODEL.ftype).get_value_type().pointee
        self.name = name
        self.lines: list[str] = []
        self.count = 0
        self.values: Any = {sympy.Symbol("t", real=True): "%t"}
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

    def line(self, text: str) -> str:
        self.count += 1
        self.lines.append(f"%v{self.count} = {text}")
        return f"%v{self.count}"

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

    def load(self, kind: str, pointer: str) -> str:
        return self.line(f"load {kind}, {kind}* {pointer}")

    def store(self, value: str, pointer: str) -> None:
        self.lines.append(f"store double {value}, double* {pointer}")

    def value(self, e: Any) -> str:
        """The name of the expression's value."""
        found: str | None = self.values.get(e)
        if found is None:
            found = self.values[e] = self.computed(e)
        return found

    def computed(self, e: Any) -> str:
        if e.is_Number or e.is_NumberSymbol:
            return _number(float(e))
        if e.is_Add:
            return self.sum(e.args)
        if e.is_Mul:
            return self.product(e.args)
        if e.is_Pow:
            return self.power(e.base, e.exp)
        name = e.func.__name__
        if name in CALLED:
            return self.call(name, *map(self.value, e.args))
        if name in SPELLED:
            return SPELLED[name](self, *e.args)
        raise NotImplementedError(f"{name} cannot be compiled: {e}")

    def operation(self, operator: str, left: str, right: str) -> str:
        return self.line(f"{operator} double {left}, {right}")

    def call(self, name: str, *arguments: str) -> str:
        return self.line(f"call double @{CALLED[name]}({', '.join(f'double {a}' for a in arguments)})")

    def chosen(self, comparison: str, left: str, right: str, then: str, other: str) -> str:
        """`then` where the comparison holds, else (and for NaN) the other."""
        holds = self.line(f"fcmp {comparison} double {left}, {right}")
        return self.line(f"select i1 {holds}, double {then}, double {other}")

    def sum(self, terms: Sequence[Any]) -> str:
        total = self.value(terms[0])
        for term in terms[1:]:
            if term.is_Mul and term.args[0] == -1:
                total = self.operation("fsub", total, self.product(term.args[1:]))
            else:
                total = self.operation("fadd", total, self.value(term))
        return total

    def product(self, factors: Sequence[Any]) -> str:
        """The number last, so that -a*b and 2*a*b share a*b."""
        if factors[0].is_Number:
            rest = self.product(factors[1:])
            return self.line(f"fneg double {rest}") if factors[0] == -1 else self.operation(
                "fmul", rest, self.value(factors[0])
            )  # fmt: skip
        if len(factors) == 1:
            return self.value(factors[0])
        key = ("product", *factors)
        found: str | None = self.values.get(key)
        if found is None:
            found = self.operation("fmul", self.product(factors[:-1]), self.value(factors[-1]))
            self.values[key] = found
        return found

    def power(self, base: Any, exponent: Any) -> str:
        if exponent.is_Integer and 0 < abs(int(exponent)) <= LONGEST_CHAIN:
            chain = self.chain(self.value(base), abs(int(exponent)))
            return chain if exponent > 0 else self.operation("fdiv", ONE, chain)
        if exponent == sympy.Rational(1, 2):
            return self.call("sqrt", self.value(base))
        return self.call("pow", self.value(base), self.value(exponent))

    def chain(self, square: str, exponent: int) -> str:
        total = ""
        while exponent:
            if exponent & 1:
                total = self.operation("fmul", total, square) if total else square
            exponent >>= 1
            square = self.operation("fmul", square, square) if exponent else square
        return total

    def absolute(self, e: Any) -> str:
        return self.call("fabs", self.value(e))

    def sign(self, e: Any) -> str:
        """-1, 0 or 1; NaN stays NaN."""
        x = self.value(e)
        below = self.chosen("olt", x, ZERO, _number(-1.0), self.operation("fmul", x, ZERO))
        return self.chosen("ogt", x, ZERO, ONE, below)

    def step(self, e: Any, *_: Any) -> str:
        # One half at the step: of equal arguments of min or max each then counts for its share.
        x = self.value(e)
        return self.chosen("ogt", x, ZERO, ONE, self.chosen("olt", x, ZERO, ZERO, HALF))

    def least(self, *terms: Any) -> str:
        return reduce(lambda old, new: self.chosen("olt", new, old, new, old), map(self.value, terms))

    def greatest(self, *terms: Any) -> str:
        return reduce(lambda old, new: self.chosen("ogt", new, old, new, old), map(self.value, terms))

    def tame_power(self, base: Any, exponent: Any) -> str:
        return self.chosen("ogt", self.value(base), ZERO, self.power(base, exponent), ZERO)

    def tame_log(self, e: Any) -> str:
        return self.chosen("ogt", self.value(e), ZERO, self.call("log", self.value(e)), ZERO)


ZERO, HALF, ONE = _number(0.0), _number(0.5), _number(1.0)

SPELLED: dict[str, Callable[..., str]] = {
    "Abs": _Function.absolute,
    "sign": _Function.sign,
    "Heaviside": _Function.step,
    "Min": _Function.least,
    "Max": _Function.greatest,
    "TamePower": _Function.tame_power,
    "TameLog": _Function.tame_log,
}
