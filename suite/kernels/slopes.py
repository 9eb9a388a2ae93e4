"""The derivative of an expression almost everywhere: steps have slope zero, and what is infinite only there counts as
zero.
"""

from __future__ import annotations

from typing import Any

import sympy

ZERO = sympy.Integer(0)


class TamePower(sympy.Function):
    """x^w in a slope: zero where x is."""

    is_real = True


class TameLog(sympy.Function):
    """log x in a slope: zero where x is."""

    is_real = True


class Slopes:
    """Derivatives of many expressions by many symbols; what they have in common is worked out once."""

    def __init__(self) -> None:
        self._free: dict[sympy.Basic, frozenset[sympy.Symbol]] = {}
        self._known: dict[tuple[sympy.Expr, sympy.Symbol], sympy.Expr] = {}

    def free(self, expression: sympy.Basic) -> frozenset[sympy.Symbol]:
        """The symbols that the expression holds."""
        if isinstance(expression, sympy.Symbol):
            return frozenset((expression,))
        found = self._free.get(expression)
        if found is None:
            found = self._free[expression] = frozenset().union(*map(self.free, expression.args))
        return found

    def of(self, expression: sympy.Expr, by: sympy.Symbol) -> sympy.Expr:
        """The derivative, finite where only the slope is infinite.

        Where sqrt(x) or |x|^w reaches zero its slope is infinite or 0 * inf; there it counts as zero. The expression
        itself is never changed, so that what is infinite stays so.
        """
        return self._tamed(self._raw(expression, by), expression)

    def _raw(self, e: Any, s: sympy.Symbol) -> Any:
        if s not in self.free(e):
            return ZERO
        if e == s:
            return sympy.Integer(1)
        found = self._known.get((e, s))
        if found is None:
            found = self._known[e, s] = self._rule(e, s)
        return found

    def _rule(self, e: Any, s: sympy.Symbol) -> Any:
        args = e.args
        inner = [self._raw(a, s) for a in args]
        if e.is_Add:
            return sympy.Add(*inner)
        if e.is_Mul:
            return sympy.Add(*(sympy.Mul(*args[:i], d, *args[i + 1 :]) for i, d in enumerate(inner) if d != 0))
        if e.is_Pow:
            # (b^w)' = b^w (w' log b + b' w / b)
            base, power = args
            by_power = inner[1] * sympy.log(base) if inner[1] != 0 else ZERO
            return e * (by_power + inner[0] * power / base)
        if e.func in (sympy.sign, sympy.Heaviside):
            return ZERO
        if e.func is sympy.Abs:
            return sympy.sign(args[0]) * inner[0]
        return sympy.Add(*(e.fdiff(i + 1) * d for i, d in enumerate(inner) if d != 0))

    def _tamed(self, slope: sympy.Expr, expression: sympy.Expr) -> sympy.Expr:
        wild = {e for e in sympy.preorder_traversal(slope) if _may_be_wild(e)}
        wild -= set(sympy.preorder_traversal(expression)) if wild else set()
        return _replaced(slope, wild) if wild else slope


def _may_be_wild(e: Any) -> bool:
    if e.is_Pow:
        return not e.exp.is_Integer or bool(e.exp < 0 and e.base.func is sympy.Abs)
    return bool(e.func is sympy.log)


def _replaced(e: Any, wild: set[Any]) -> Any:
    if not e.args:
        return e
    args = [_replaced(a, wild) for a in e.args]
    if e in wild:
        return TameLog(*args) if e.func is sympy.log else TamePower(*args)
    return e.func(*args) if any(new is not old for new, old in zip(args, e.args, strict=True)) else e
