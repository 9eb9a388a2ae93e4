"""From expressions to compiled functions: rates and outputs with their derivatives by state and parameter.

The text of one module is generated, written under a name that is a hash of its content and of the versions, and
imported; numba keeps the machine code beside it. A program may hold gated terms: parts that are only evaluated where
`on[k]` is set, so that a library of candidate terms costs nothing while it is not looked at.
"""

from __future__ import annotations

import hashlib
import importlib.util
import linecache
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from numba.core.types.function_type import CompileResultWAP
from sympy.printing.pycode import PythonCodePrinter

from suite.expressions import plain, symbol
from suite.kernels import cache
from suite.kernels.cache import numba
from suite.kernels.types import MODEL, MODEL_FUNCTION

Array = npt.NDArray[np.float64]
Expr = sympy.Expr


class TamePower(sympy.Function):  # type: ignore[misc]
    """x^w in a slope: zero where x is."""

    is_real = True


class TameLog(sympy.Function):  # type: ignore[misc]
    """log x in a slope: zero where x is."""

    is_real = True


@dataclass(frozen=True)
class Gate:
    """A term that can be switched on: what it adds to rates and outputs (by index), and the states that it brings
    along, by name with their rates. Its parameters are among all.
    """

    rates: Mapping[int, sympy.Expr] = field(default_factory=dict)
    outputs: Mapping[int, sympy.Expr] = field(default_factory=dict)
    states: Mapping[str, sympy.Expr] = field(default_factory=dict)

    def through(self, change: Callable[[Expr], Expr]) -> Gate:
        """The gate with every expression changed."""
        return Gate(*({key: change(e) for key, e in part.items()} for part in (self.rates, self.outputs, self.states)))


@dataclass(frozen=True, eq=False)
class Program:
    """Compiled `rate(t, x, u, p, on, dx, Fx, Fp)` and `output(t, x, u, p, on, y, Hx, Hp)`.

    Both write their last three arguments, and of the derivatives only those that can differ from zero: the caller's
    arrays start at zero and serve one program. Shapes: x (n,), u (inputs,), p (parameters,), on (gates,), Fx (n, n),
    Fp (n, parameters), Hx (outputs, n), Hp (outputs, parameters). Columns of Fp and Hp that belong to a gate are
    written only while it is on.

    on[k] is 0 while gate k is off, else 1; a gate that brings states along is switched on by the place of the first
    of them in x, behind the program's own n, so that x holds the states of active gates only.
    """

    n: int
    inputs: int
    parameters: int
    outputs_count: int
    gates: int
    module: ModuleType

    @cached_property
    def rate(self) -> Any:
        return _Address(self.module.rate)

    @cached_property
    def output(self) -> Any:
        return _Address(self.module.output)

    def all_off(self) -> npt.NDArray[np.int64]:
        """The gate switches, all off, (gates,)."""
        return np.zeros(self.gates, dtype=np.int64)

    def rates(self, t: float, x: Array, u: Sequence[float] | Array, p: Array) -> tuple[Array, Array, Array]:
        """f, df/dx, df/dp at one point, all gates off."""
        dx, Fx, Fp = np.zeros(self.n), np.zeros((self.n, self.n)), np.zeros((self.n, self.parameters))
        self.rate(float(t), _vector(x), _vector(u), _vector(p), self.all_off(), dx, Fx, Fp)
        return dx, Fx, Fp

    def outputs(self, t: float, x: Array, u: Sequence[float] | Array, p: Array) -> tuple[Array, Array, Array]:
        """h, dh/dx, dh/dp at one point, all gates off."""
        ny = self.outputs_count
        y, Hx, Hp = np.zeros(ny), np.zeros((ny, self.n)), np.zeros((ny, self.parameters))
        self.output(float(t), _vector(x), _vector(u), _vector(p), self.all_off(), y, Hx, Hp)
        return y, Hx, Hp


class _Address:
    """A compiled function as its address; a kernel would look a dispatcher up anew at every call, for 1 ms.

    `_numba_type_` and `__wrapper_address__` are numba's protocols for objects with a known type and for functions.
    """

    _numba_type_ = MODEL

    def __init__(self, function: Any) -> None:
        self.function = function
        self._address = CompileResultWAP(function.get_compile_result(MODEL_FUNCTION)).__wrapper_address__()

    def __wrapper_address__(self) -> int:
        return int(self._address)

    def __call__(self, *arguments: Any) -> None:
        self.function(*arguments)


def _vector(values: Sequence[float] | Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64)


def compile_program(
    *,
    states: Sequence[str],
    inputs: Sequence[str],
    parameters: Sequence[str],
    rates: Sequence[sympy.Expr],
    outputs: Sequence[sympy.Expr],
    gates: Sequence[Gate] = (),
) -> Program:
    """Compile rates and outputs (and gated terms) of the named states, inputs and parameters."""
    names = (tuple(states), tuple(inputs), tuple(parameters))

    def source() -> str:
        moving = [(gate.rates, gate.states) for gate in gates]
        reading = [(gate.outputs, gate.states) for gate in gates]
        return "\n\n".join(
            [
                HEADER,
                _function("rate", "dx, Fx, Fp", rates, moving, names, moving=True),
                _function("output", "y, Hx, Hp", outputs, reading, names),
            ]
        )

    parts = [[plain(e) for e in rates], [plain(e) for e in outputs]]
    parts += [[f"{key} {plain(e)}" for p in (g.rates, g.outputs, g.states) for key, e in p.items()] for g in gates]
    module = _load(repr((names, parts)), source)
    return Program(len(states), len(inputs), len(parameters), len(outputs), len(gates), module)


HEADER = '''"""Generated; safe to delete."""

import math

from suite.kernels.types import MODEL_FUNCTION
from suite.kernels.cache import compile_kernel
from suite.kernels.steps import sign, tame_log, tame_power'''


class _Printer(PythonCodePrinter):  # type: ignore[misc]
    """Scalar code of the math module; sign and step functions are spelled out."""

    def _print_Symbol(self, expr: Any) -> str:
        # Declared names get a prefix, so that none can collide with the text around them.
        return str(expr.name) if expr.name == "t" or expr.name.startswith("_c") else f"s_{expr.name}"

    def _print_sign(self, expr: sympy.Expr) -> str:
        return f"sign({self._print(expr.args[0])})"

    def _print_TamePower(self, expr: sympy.Expr) -> str:
        return f"tame_power({self._print(expr.args[0])}, {self._print(expr.args[1])})"

    def _print_TameLog(self, expr: sympy.Expr) -> str:
        return f"tame_log({self._print(expr.args[0])})"

    def _print_Heaviside(self, expr: sympy.Expr) -> str:
        return f"(1.0 if {self._print(expr.args[0])} > 0.0 else 0.0)"

    def _print_DiracDelta(self, expr: sympy.Expr) -> str:
        return "0.0"

    def _print_Integer(self, expr: sympy.Expr) -> str:
        return f"{int(expr)}.0"

    def _print_Rational(self, expr: sympy.Expr) -> str:
        return repr(float(expr))

    def _print_Float(self, expr: sympy.Expr) -> str:
        return repr(float(expr))

    def _print_Pow(self, expr: sympy.Expr, rational: bool = False) -> str:
        base, exponent = expr.as_base_exp()
        text = self.parenthesize(base, 100)
        if exponent.is_Integer and 0 < abs(int(exponent)) <= 64:
            power = text if abs(int(exponent)) == 1 else f"{text}**{abs(int(exponent))}"
            return power if exponent > 0 else f"(1.0/({power}))"
        if exponent == sympy.Rational(1, 2):
            return f"math.sqrt({self._print(base)})"
        return f"({text}**({self._print(exponent)}))"

    def _print_Abs(self, expr: sympy.Expr) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Min(self, expr: sympy.Expr) -> str:
        return f"min({', '.join(self._print(a) for a in expr.args)})"

    def _print_Max(self, expr: sympy.Expr) -> str:
        return f"max({', '.join(self._print(a) for a in expr.args)})"


def _function(
    name: str,
    written: str,
    base: Sequence[sympy.Expr],
    gated: Sequence[tuple[Mapping[int, sympy.Expr], Mapping[str, sympy.Expr]]],
    names: tuple[tuple[str, ...], ...],
    *,
    moving: bool = False,
) -> str:
    """The text of one function: its values, Jacobian by the state and Jacobian by the parameters.

    `gated` holds each gate's additions and its states with their rates, which are written if `moving`.
    """
    value, by_x, by_p = written.split(", ")
    X, U, P = ([symbol(s) for s in group] for group in names)
    own = _owned(P, base, [[*terms.values(), *states.values()] for terms, states in gated])
    blocks: list[str] = []
    touched: set[str] = set()
    for k, (terms, states) in enumerate(gated):
        added: dict[str, sympy.Expr] = {}
        fresh: dict[str, sympy.Expr] = {}
        mine = [(j, s) for j, s in enumerate(P) if own.get(s) == k]
        # Where the gate's own states stand in x, and everything that it alone writes.
        places = [f"on[{k}] + {j}" if j else f"on[{k}]" for j in range(len(states))]
        brought = list(zip(map(symbol, states), places, strict=True))
        for i, expression in terms.items():
            added[f"{value}[{i}]"] = expression
            added |= {f"{by_x}[{i}, {j}]": _derivative(expression, s) for j, s in enumerate(X)}
            added |= {f"{by_p}[{i}, {j}]": _derivative(expression, s) for j, s in enumerate(P) if s not in own}
            fresh |= {f"{by_p}[{i}, {j}]": _derivative(expression, s) for j, s in mine}
            fresh |= {f"{by_x}[{i}, {place}]": _derivative(expression, z) for z, place in brought}
        for place, rate in zip(places, states.values() if moving else (), strict=moving):
            fresh[f"{value}[{place}]"] = rate
            across = [*((s, str(j)) for j, s in enumerate(X)), *brought]
            fresh |= {f"{by_x}[{place}, {j}]": _derivative(rate, s) for s, j in across}
            fresh |= {f"{by_p}[{place}, {j}]": _derivative(rate, s) for j, s in enumerate(P) if rate.has(s)}
        added = {target: part for target, part in added.items() if part != 0}
        fresh = {target: part for target, part in fresh.items() if part != 0 or target.startswith(f"{value}[")}
        touched |= set(added)
        if added or fresh:
            blocks.append(f"    if on[{k}] != 0:")
            blocks += [f"        s_{s} = p[{j}]" for j, s in mine]
            blocks += [f"        s_{z} = x[{place}]" for z, place in brought]
            blocks += _assignments(added, "+=", "        ") + _assignments(fresh, "=", "        ")
    targets: dict[str, sympy.Expr] = {}
    for i, expression in enumerate(base):
        targets[f"{value}[{i}]"] = expression
        slopes = {f"{by_x}[{i}, {j}]": _derivative(expression, s) for j, s in enumerate(X)}
        slopes |= {f"{by_p}[{i}, {j}]": _derivative(expression, s) for j, s in enumerate(P) if s not in own}
        # What a gate adds to starts at zero; what nobody ever writes is zero as the caller made it.
        targets |= {target: part for target, part in slopes.items() if part != 0 or target in touched}
    shared = [s for s in P if s not in own]
    lines = [f"    s_{s} = {g}[{j}]" for g, part in zip("xu", (X, U), strict=True) for j, s in enumerate(part)]
    lines += [f"    s_{s} = p[{j}]" for j, s in enumerate(P) if s in _used(shared, base, gated)]
    lines += _assignments(targets, "=", "    ")
    lines += blocks
    head = f"@compile_kernel(MODEL_FUNCTION)\ndef {name}(t, x, u, p, on, {written}):"
    return "\n".join([head, *lines, "    return"])


def _used(
    shared: Sequence[sympy.Symbol],
    base: Sequence[sympy.Expr],
    gated: Sequence[tuple[Mapping[int, sympy.Expr], Mapping[str, sympy.Expr]]],
) -> set[sympy.Basic]:
    """The shared parameters that stand in anything at all."""
    gates = [e for terms, states in gated for e in (*terms.values(), *states.values())]
    free: set[sympy.Basic] = set().union(*(e.free_symbols for e in (*base, *gates)))
    return free & set(shared)


def _owned(
    P: Sequence[sympy.Symbol], base: Sequence[sympy.Expr], gated: Sequence[Sequence[sympy.Expr]]
) -> dict[sympy.Symbol, int]:
    """Parameters that one gate alone uses, with that gate: their columns cost nothing while it is off."""
    in_base = set().union(*(expression.free_symbols for expression in base)) if base else set()
    users: dict[sympy.Basic, set[int]] = {}
    for k, terms in enumerate(gated):
        for expression in terms:
            for s in expression.free_symbols:
                users.setdefault(s, set()).add(k)
    return {s: next(iter(users[s])) for s in P if s not in in_base and len(users.get(s, ())) == 1}


def _derivative(expression: sympy.Expr, by: sympy.Symbol) -> sympy.Expr:
    """The derivative almost everywhere: steps have slope zero."""
    if not expression.has(by):
        return sympy.Integer(0)
    slope: Any = sympy.diff(expression, by)
    slope = slope.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
    # Where sqrt(x) or |x|^w reaches zero its slope is infinite or 0 * inf; there it counts as zero. The expression
    # itself is never changed, so that what is infinite stays so.
    slope = slope.replace(
        lambda e: e.is_Pow and (not e.exp.is_Integer or (e.exp < 0 and e.base.func is sympy.Abs))
        and not expression.has(e),
        lambda e: TamePower(e.base, e.exp),
    )  # fmt: skip
    tamed: sympy.Expr = slope.replace(
        lambda e: e.func is sympy.log and not expression.has(e), lambda e: TameLog(*e.args)
    )
    return tamed


def _assignments(targets: Mapping[str, sympy.Expr], operator: str, indent: str) -> list[str]:
    printer = _Printer({"fully_qualified_modules": True})
    shared, reduced = sympy.cse(list(targets.values()), symbols=sympy.numbered_symbols("_c", real=True), order="none")
    lines = [f"{indent}{name} = {printer.doprint(part)}" for name, part in shared]
    return lines + [f"{indent}{t} {operator} {printer.doprint(e)}" for t, e in zip(targets, reduced, strict=True)]


@lru_cache(maxsize=1)
def _generator() -> str:
    """A hash of this file: another generator writes other text for the same model."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


def _load(key: str, source: Callable[[], str]) -> ModuleType:
    """Import the generated text: from the cache folder as a real file (numba caches nothing else), or from memory.

    The file is named by a hash of everything that its text follows from, the versions and the generator among them, so
    that a known program is not even written anew.
    """
    versions = f"{numba.__version__} {np.__version__} {sympy.__version__} {sys.version} {_generator()}"
    stem = "model_" + hashlib.sha256((key + versions).encode()).hexdigest()[:24]
    if stem in sys.modules:
        return sys.modules[stem]
    place = cache.folder()
    if place is None:
        module = ModuleType(stem)
        text = source()
        linecache.cache[f"<{stem}>"] = (len(text), None, text.splitlines(True), f"<{stem}>")
        exec(compile(text, f"<{stem}>", "exec"), module.__dict__)
        sys.modules[stem] = module
        return module
    path = place / f"{stem}.py"
    if not path.exists():
        with tempfile.NamedTemporaryFile("w", dir=place, suffix=".tmp", delete=False, encoding="utf-8") as handle:
            handle.write(source())
        os.replace(handle.name, path)
    spec = importlib.util.spec_from_file_location(stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[stem] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[stem]
        raise
    return module
