"""Text to sympy through a whitelist of syntax; nothing a user writes is ever evaluated as Python.

The text is parsed to a syntax tree, and only numbers, declared names, the four operations, powers and the
functions below are translated. Size and depth are checked on the raw text first, so that a hostile string costs
less than reading it; constants are folded in floating point, so that no power tower is computed, neither of numbers
nor of the coefficients that sympy draws out of a power.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from typing import Any, cast

import sympy
from sympy.printing.str import StrPrinter

from suite.bracketing import DEEPEST, nesting
from suite.errors import ModelError

LONGEST = 10_000
LAYERS = 16  # functions, powers and quotients within each other; sympy's effort grows steeply with them
LARGEST_EXPONENT = 64
LONG = 2**53  # above it a whole number is not exact in floating point


def _abs(e: sympy.Expr) -> sympy.Expr:
    """The absolute value. Of a power whose exponent it cannot see to be real sympy takes real and imaginary parts; here
    all numbers are real.
    """
    found: Any = sympy.Abs(e)
    if found.has(sympy.re, sympy.im):
        found = found.replace(sympy.im, lambda _: sympy.S.Zero).replace(sympy.re, lambda part: part)
    return cast(sympy.Expr, found)


FUNCTIONS: dict[str, tuple[int, Callable[..., sympy.Expr]]] = {
    "sin": (1, sympy.sin),
    "cos": (1, sympy.cos),
    "tan": (1, sympy.tan),
    "asin": (1, sympy.asin),
    "acos": (1, sympy.acos),
    "atan": (1, sympy.atan),
    "atan2": (2, sympy.atan2),
    "sinh": (1, sympy.sinh),
    "cosh": (1, sympy.cosh),
    "tanh": (1, sympy.tanh),
    "exp": (1, sympy.exp),
    "log": (1, sympy.log),
    "sqrt": (1, sympy.sqrt),
    "abs": (1, _abs),
    "sign": (1, sympy.sign),
    "min": (2, sympy.Min),
    "max": (2, sympy.Max),
}
CONSTANTS = {"pi": sympy.pi}
TIME = "t"
RESERVED = frozenset(FUNCTIONS) | frozenset(CONSTANTS) | {TIME}

_FLOAT_OF: dict[str, Callable[..., Any]] = {
    **{name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)},
    "abs": abs,
    "sign": lambda x: float((x > 0) - (x < 0)),
    "min": min,
    "max": max,
}


def symbol(name: str) -> sympy.Symbol:
    """The symbol of a declared name; real, so that abs, sign and max have derivatives."""
    return sympy.Symbol(name, real=True)


def parse(text: str, names: Collection[str], where: str) -> sympy.Expr:
    """Translate one equation's right-hand side.

    `names` are the declared names (the time t and pi need no declaration); `where` opens every error sentence,
    such as "plant.toml, [states] v". Raises ModelError for anything outside the whitelist.
    """
    if not isinstance(text, str):
        raise ModelError(f"{where}: expected an equation as text, got {text!r}; put it in quotes")
    return _parsed(text, frozenset(names), where)


@lru_cache(maxsize=4096)  # models are rebuilt with other values far more often than with other equations
def _parsed(text: str, names: frozenset[str], where: str) -> sympy.Expr:
    if len(text) > LONGEST:
        raise ModelError(f"{where}: the equation has {len(text)} characters, at most {LONGEST} are read; split it")
    if "#" in text:
        raise ModelError(f"{where}: '#' is not allowed in an equation; put the comment outside the quotes")
    line = " ".join(text.split()).replace("^", "**")
    if not line:
        raise ModelError(f"{where}: the equation is empty; write 0 for a rate of zero")
    if nesting(line) > DEEPEST:
        raise ModelError(f"{where}: more than {DEEPEST} nested brackets, signs or powers; simplify the equation")
    try:
        with warnings.catch_warnings():
            # Python warns of odd syntax that is refused here anyway.
            warnings.simplefilter("ignore")
            tree = ast.parse(line, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else "it cannot be parsed"
        said = f"{_short(text)!r} is not an equation ({reason})"
        raise ModelError(f"{where}: {said}; check brackets and operators") from None
    return _Translator(names, where, line).visit(tree.body)


class _Plain(StrPrinter):
    """Text that `parse` reads back to the same numbers: all digits, our function names, two arguments at a time."""

    def _print_Float(self, expr: sympy.Float) -> str:
        return repr(float(expr))

    def _print_Abs(self, expr: sympy.Expr) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Min(self, expr: Any) -> str:
        return self._pairs("min", expr.args)

    def _print_Max(self, expr: Any) -> str:
        return self._pairs("max", expr.args)

    def _pairs(self, name: str, arguments: Sequence[sympy.Expr]) -> str:
        first, *rest = arguments
        text = str(self._print(first))
        for argument in rest:
            text = f"{name}({text}, {self._print(argument)})"
        return text


def plain(expression: sympy.Expr) -> str:
    """The expression as text that `parse` reads back."""
    return str(_Plain().doprint(expression))


def latex(expression: sympy.Expr) -> str:
    """The expression as LaTeX."""
    return str(sympy.latex(expression))


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


class _Translator:
    """One pass over the syntax tree; every node kind that is not named here is refused."""

    def __init__(self, names: frozenset[str], where: str, text: str) -> None:
        self.names = names
        self.where = where
        self.text = text
        self.layers = 0

    def refuse(self, what: str, mend: str) -> ModelError:
        return ModelError(f"{self.where}: {what}; {mend}")

    def visit(self, node: ast.expr) -> sympy.Expr:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return self.number(value)
            case ast.Name(id=name):
                return self.name(name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
                inner = self.visit(operand)
                return -inner if isinstance(op, ast.USub) else inner
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self.sum(node)
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self.product(node)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self.power(self.inner(left), self.inner(right))
            case ast.BinOp():
                raise self.refuse(f"the operator in {self.said(node)} is not allowed", "use + - * / and ** (or ^)")
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                return self.call(name, args)
        raise self.refuse(
            f"{self.said(node)} is not allowed in an equation",
            "use numbers, declared names, + - * / ** and the listed functions",
        )

    def inner(self, node: ast.expr) -> sympy.Expr:
        """What stands within a function, a power or below a fraction line."""
        self.layers += 1
        if self.layers > LAYERS:
            raise self.refuse(f"more than {LAYERS} functions, powers or quotients within each other", "simplify it")
        expression = self.visit(node)
        self.layers -= 1
        return expression

    def said(self, node: ast.expr) -> str:
        return repr(_short(ast.get_source_segment(self.text, node) or self.text))

    def sum(self, node: ast.expr) -> sympy.Expr:
        """Of a + b - c ...: in a loop, as long sums are deep trees, and in one go, as sympy sorts at every +."""
        terms = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            term = self.visit(node.right)
            terms.append(-term if isinstance(node.op, ast.Sub) else term)
            node = node.left
        return self.bounded(sympy.Add(self.visit(node), *reversed(terms)))

    def product(self, node: ast.expr) -> sympy.Expr:
        """Of a * b / c ..., likewise."""
        factors = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            factor = self.inner(node.right) if isinstance(node.op, ast.Div) else self.visit(node.right)
            if isinstance(node.op, ast.Div):
                if factor.is_zero:
                    raise self.refuse("division by zero", "check the denominator")
                factor = 1 / factor
            factors.append(factor)
            node = node.left
        return self.bounded(sympy.Mul(self.visit(node), *reversed(factors)))

    def bounded(self, expression: Any) -> sympy.Expr:
        """The expression with long exact numbers in floating point; what overflows is refused."""
        if expression.is_Rational:
            if max(abs(expression.p), expression.q) < LONG:
                return expression
            return self.number(self.finite(lambda: float(expression)))
        if expression.is_number:
            return expression if expression.has(sympy.pi) else self.number(self.finite(lambda: float(expression)))
        head, rest = expression.as_coeff_Mul()
        if head.is_Rational and max(abs(head.p), head.q) < LONG:
            return expression
        return self.number(self.finite(lambda: float(head))) * rest

    def number(self, value: int | float) -> sympy.Expr:
        if isinstance(value, int):
            if abs(value) >= LONG:
                return self.number(self.finite(lambda: float(value)))
            return sympy.Integer(value)
        if not math.isfinite(value):
            raise self.refuse("a number is too large", "write it below 1e308")
        return sympy.Integer(int(value)) if value == int(value) and abs(value) < LONG else sympy.Float(value)

    def name(self, name: str) -> sympy.Expr:
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.names or name == TIME:
            return symbol(name)
        if name in FUNCTIONS:
            raise self.refuse(f"{name} is a function", f"write {name}(...)")
        raise self.refuse(f"{name!r} is not declared", "add it to [inputs] or [parameters]")

    def power(self, base: Any, exponent: sympy.Expr) -> sympy.Expr:
        if not exponent.is_number:
            if base.is_number and self.finite(lambda: float(base)) <= 0.0:
                raise self.refuse(f"{float(base):g} to a power that varies has no real value", "use a positive base")
            return self.real(self.bounded(base**exponent))
        value = self.finite(lambda: float(exponent))
        # sympy merges (x**64)**64 to one power, so that towers of small exponents count as one large one.
        inner = float(base.exp) if base.is_Pow and base.exp.is_number else 1.0
        if max(abs(value), abs(value * inner)) > LARGEST_EXPONENT:
            raise self.refuse(f"an exponent of {value * inner:g} is too large", f"use at most {LARGEST_EXPONENT}")
        if base.is_number:
            return self.number(self.finite(lambda: float(base) ** value))
        return self.real(self.bounded(base ** (sympy.Integer(int(value)) if value == int(value) else exponent)))

    def call(self, name: str, nodes: Sequence[ast.expr]) -> sympy.Expr:
        if name not in FUNCTIONS:
            known = " ".join(sorted(FUNCTIONS))
            raise self.refuse(f"{name!r} is not a function of the model language", f"use one of {known}")
        count, function = FUNCTIONS[name]
        if len(nodes) != count:
            raise self.refuse(f"{name} takes {count} argument(s), got {len(nodes)}", "check the call")
        arguments = [self.inner(node) for node in nodes]
        if all(argument.is_number for argument in arguments):
            return self.number(self.finite(lambda: _FLOAT_OF[name](*(float(a) for a in arguments))))
        return self.real(function(*arguments))

    def real(self, expression: sympy.Expr) -> sympy.Expr:
        """The expression; refused where sympy sees a root of what is never positive, such as sqrt(-2*x**2)."""
        if expression.has(sympy.I):
            raise self.refuse("a root or power of a negative number has no real value", "check the signs")
        return expression

    def finite(self, compute: Callable[[], float]) -> float:
        """A constant folded in floating point; complex, infinite and undefined constants are refused."""
        try:
            value = compute()
        except (OverflowError, ValueError, ZeroDivisionError, TypeError):
            value = math.nan
        if isinstance(value, complex) or not math.isfinite(value):
            raise self.refuse("a constant is too large or undefined", "check the numbers in the equation")
        return value
