"""From expressions to LLVM's text, line by line: an expression that occurs again is not computed again."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import sympy

LONGEST_CHAIN = 64  # whole powers up to here are chains of products

INTRINSICS = {name: f"llvm.{name}.f64" for name in ("sin", "cos", "exp", "log", "sqrt", "fabs", "pow", "ceil")}
LIBRARY = {name: name for name in ("tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")}
CALLED = INTRINSICS | LIBRARY
WITH_TWO = ("pow", "atan2")


def declared() -> list[str]:
    """The declarations of all functions that lines may call."""
    return [
        f"declare double @{callee}({', '.join(['double'] * (2 if name in WITH_TWO else 1))})"
        for name, callee in CALLED.items()
    ]


def number(value: float) -> str:
    """A constant, exactly."""
    return f"0x{struct.pack('>d', value).hex().upper()}"


class Lines:
    """The lines of one function, and the name of each value that is computed already."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.count = 0
        self.values: Any = {sympy.Symbol("t", real=True): "%t"}

    def line(self, text: str) -> str:
        """Add a line; returns the name of what it computes."""
        self.count += 1
        self.lines.append(f"%v{self.count} = {text}")
        return f"%v{self.count}"

    def load(self, kind: str, pointer: str) -> str:
        """The name of what stands at a pointer."""
        return self.line(f"load {kind}, {kind}* {pointer}")

    def store(self, value: str, pointer: str) -> None:
        """Write a value to where a pointer points."""
        self.lines.append(f"store double {value}, double* {pointer}")

    def value(self, e: Any) -> str:
        """The name of the expression's value."""
        found: str | None = self.values.get(e)
        if found is None:
            found = self.values[e] = self.computed(e)
        return found

    def computed(self, e: Any) -> str:
        """Lines for an expression that has none yet; the name of its value."""
        if e.is_Number or e.is_NumberSymbol:
            return number(float(e))
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
        """Two values and an operator of LLVM."""
        return self.line(f"{operator} double {left}, {right}")

    def call(self, name: str, *arguments: str) -> str:
        """A function of CALLED at values."""
        return self.line(f"call double @{CALLED[name]}({', '.join(f'double {a}' for a in arguments)})")

    def chosen(self, comparison: str, left: str, right: str, then: str, other: str) -> str:
        """`then` where the comparison holds, else (and for NaN) the other."""
        holds = self.line(f"fcmp {comparison} double {left}, {right}")
        return self.line(f"select i1 {holds}, double {then}, double {other}")

    def sum(self, terms: Sequence[Any]) -> str:
        """The terms one after another, a negated one taken away."""
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
        """Whole powers as products, a half as a root."""
        if exponent.is_Integer and 0 < abs(int(exponent)) <= LONGEST_CHAIN:
            chain = self.chain(self.value(base), abs(int(exponent)))
            return chain if exponent > 0 else self.operation("fdiv", ONE, chain)
        if exponent == sympy.Rational(1, 2):
            return self.call("sqrt", self.value(base))
        return self.call("pow", self.value(base), self.value(exponent))

    def chain(self, square: str, exponent: int) -> str:
        """A whole power above zero of a value, by squaring."""
        total = ""
        while exponent:
            if exponent & 1:
                total = self.operation("fmul", total, square) if total else square
            exponent >>= 1
            square = self.operation("fmul", square, square) if exponent else square
        return total

    def absolute(self, e: Any) -> str:
        """Without its sign."""
        return self.call("fabs", self.value(e))

    def sign(self, e: Any) -> str:
        """-1, 0 or 1; NaN stays NaN."""
        x = self.value(e)
        below = self.chosen("olt", x, ZERO, number(-1.0), self.operation("fmul", x, ZERO))
        return self.chosen("ogt", x, ZERO, ONE, below)

    def step(self, e: Any, *_: Any) -> str:
        """0, one half at 0, or 1."""
        # One half at the step: of equal arguments of min or max each then counts for its share.
        x = self.value(e)
        return self.chosen("ogt", x, ZERO, ONE, self.chosen("olt", x, ZERO, ZERO, HALF))

    def least(self, *terms: Any) -> str:
        """The smallest; the first of equal ones."""
        return reduce(lambda old, new: self.chosen("olt", new, old, new, old), map(self.value, terms))

    def greatest(self, *terms: Any) -> str:
        """The largest; the first of equal ones."""
        return reduce(lambda old, new: self.chosen("ogt", new, old, new, old), map(self.value, terms))

    def tame_power(self, base: Any, exponent: Any) -> str:
        """The power of a base above zero, else zero."""
        return self.chosen("ogt", self.value(base), ZERO, self.power(base, exponent), ZERO)

    def tame_log(self, e: Any) -> str:
        """The logarithm of what is above zero, else zero."""
        return self.chosen("ogt", self.value(e), ZERO, self.call("log", self.value(e)), ZERO)


ZERO, HALF, ONE = number(0.0), number(0.5), number(1.0)

SPELLED: dict[str, Callable[..., str]] = {
    "Abs": Lines.absolute,
    "sign": Lines.sign,
    "Heaviside": Lines.step,
    "Min": Lines.least,
    "Max": Lines.greatest,
    "TamePower": Lines.tame_power,
    "TameLog": Lines.tame_log,
}
