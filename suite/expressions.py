"""Text to sympy through a whitelist of syntax; nothing a user writes is ever evaluated as Python.

The text is parsed to a syntax tree, and only numbers, declared names, the four operations, powers and the
functions below are translated. Size and depth are checked on the raw text first, so that a hostile string costs
less than reading it; constant sub-expressions are folded in floating point, so that no power tower is computed.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Collection

import sympy

from suite.errors import ModelError

LONGEST = 10_000
DEEPEST = 100
LARGEST_EXPONENT = 64

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
    "abs": (1, sympy.Abs),
    "sign": (1, sympy.sign),
    "min": (2, sympy.Min),
    "max": (2, sympy.Max),
}
CONSTANTS = {"pi": sympy.pi}
TIME = "t"
RESERVED = frozenset(FUNCTIONS) | frozenset(CONSTANTS) | {TIME}

_FLOAT_OF: dict[str, Callable[..., float]] = {
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
    if len(text) > LONGEST:
        raise ModelError(f"{where}: the equation has {len(text)} characters, at most {LONGEST} are read; split it")
    if _nesting(text) > DEEPEST:
        raise ModelError(f"{where}: more than {DEEPEST} nested brackets or signs; simplify the equation")
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else "it cannot be parsed"
        raise ModelError(f"{where}: {_short(text)!r} is not an equation ({reason}); check brackets and operators") from None
    return _Translator(frozenset(names), where, text).visit(tree.body, 0)


def plain(expression: sympy.Expr) -> str:
    """The expression as text that `parse` reads back."""
    text = str(sympy.sstr(expression))
    for ours, theirs in (("abs(", "Abs("), ("min(", "Min("), ("max(", "Max(")):
        text = text.replace(theirs, ours)
    return text


def latex(expression: sympy.Expr) -> str:
    """The expression as LaTeX."""
    return str(sympy.latex(expression))


def _nesting(text: str) -> int:
    """An upper bound of the depth of the syntax tree, read off the characters."""
    depth = deepest = run = 0
    for character in text:
        if character in "([{":
            depth += 1
        elif character in ")]}":
            depth -= 1
        # A run of signs (--------x) or of powers nests without a bracket.
        run = run + 1 if character in "+-*~ " else 0
        deepest = max(deepest, depth, run)
    return max(deepest, text.count("**") + text.count("^"))


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


class _Translator:
    """One pass over the syntax tree; every node kind that is not named here is refused."""

    def __init__(self, names: frozenset[str], where: str, text: str) -> None:
        self.names = names
        self.where = where
        self.text = text

    def refuse(self, what: str, mend: str) -> ModelError:
        return ModelError(f"{self.where}: {what}; {mend}")

    def visit(self, node: ast.expr, depth: int) -> sympy.Expr:
        if depth > 10 * DEEPEST:
            raise self.refuse("the equation is nested too deeply", "split it")
        match node:
            case ast.Constant(value=value) if type(value) in (int, float):
                return self.number(value)
            case ast.Name(id=name):
                return self.name(name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
                inner = self.visit(operand, depth + 1)
                return -inner if isinstance(op, ast.USub) else inner
            case ast.BinOp(left=left, op=op, right=right):
                return self.binary(op, self.visit(left, depth + 1), self.visit(right, depth + 1))
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                return self.call(name, [self.visit(argument, depth + 1) for argument in args])
        raise self.refuse(
            f"{_short(ast.unparse(node)) if depth < DEEPEST else _short(self.text)!r} is not allowed in an equation",
            "use numbers, declared names, + - * / ** and the listed functions",
        )

    def number(self, value: int | float) -> sympy.Expr:
        if isinstance(value, int):
            if abs(value) >= 2**53:
                return self.number(self.finite(lambda: float(value)))
            return sympy.Integer(value)
        if not math.isfinite(value):
            raise self.refuse("a number is too large", "write it below 1e308")
        return sympy.Integer(int(value)) if value == int(value) and abs(value) < 2**53 else sympy.Float(value)

    def name(self, name: str) -> sympy.Expr:
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.names or name == TIME:
            return symbol(name)
        if name in FUNCTIONS:
            raise self.refuse(f"{name} is a function", f"write {name}(...)")
        raise self.refuse(f"{name!r} is not declared", "add it to [inputs] or [parameters]")

    def binary(self, op: ast.operator, left: sympy.Expr, right: sympy.Expr) -> sympy.Expr:
        match op:
            case ast.Add():
                return left + right
            case ast.Sub():
                return left - right
            case ast.Mult():
                return left * right
            case ast.Div():
                if right.is_zero:
                    raise self.refuse("division by zero", "check the denominator")
                return left / right
            case ast.Pow():
                return self.power(left, right)
        raise self.refuse("an operator is not allowed in an equation", "use + - * / and ** (or ^)")

    def power(self, base: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
        if not exponent.is_number:
            return base**exponent
        value = float(exponent)
        if abs(value) > LARGEST_EXPONENT:
            raise self.refuse(f"an exponent of {value:g} is too large", f"use at most {LARGEST_EXPONENT}")
        if base.is_number:
            return self.number(self.finite(lambda: float(base) ** value))
        return base ** (sympy.Integer(int(value)) if value == int(value) else exponent)

    def call(self, name: str, arguments: list[sympy.Expr]) -> sympy.Expr:
        if name not in FUNCTIONS:
            known = " ".join(sorted(FUNCTIONS))
            raise self.refuse(f"{name!r} is not a function of the model language", f"use one of {known}")
        count, function = FUNCTIONS[name]
        if len(arguments) != count:
            raise self.refuse(f"{name} takes {count} argument(s), got {len(arguments)}", "check the call")
        if all(argument.is_number for argument in arguments):
            return self.number(self.finite(lambda: _FLOAT_OF[name](*(float(a) for a in arguments))))
        return function(*arguments)

    def finite(self, compute: Callable[[], float]) -> float:
        """A constant folded in floating point; complex, infinite and undefined constants are refused."""
        try:
            value = compute()
        except (OverflowError, ValueError, ZeroDivisionError, TypeError):
            value = math.nan
        if isinstance(value, complex) or not math.isfinite(value):
            raise self.refuse("a constant is too large or undefined", "check the numbers in the equation")
        return value
