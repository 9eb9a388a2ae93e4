"""What a model's compiled functions write: rates and outputs with their derivatives by state and parameter.

A program may hold gated terms: parts that are only evaluated where `on[k]` is set, so that a library of candidate terms
costs nothing while it is not looked at.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import sympy

from suite.expressions import symbol
from suite.kernels import lines, native, object_code, slopes, unrolled
from suite.kernels.native import Block, Place, Target
from suite.kernels.object_code import Address
from suite.kernels.slopes import Slopes

Array = npt.NDArray[np.float64]
Expr: TypeAlias = sympy.Expr


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
        rates, outputs = ({i: change(e) for i, e in part.items()} for part in (self.rates, self.outputs))
        return Gate(rates, outputs, {z: change(e) for z, e in self.states.items()})


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
    functions: Callable[[str], Address]

    @cached_property
    def rate(self) -> Any:
        """Compiled f and its slopes: of (t, x, u, p, on, f, Fx, Fp) it writes the last three."""
        return self.functions("rate")

    @cached_property
    def output(self) -> Any:
        """Compiled h and its slopes: of (t, x, u, p, on, y, Hx, Hp) it writes the last three."""
        return self.functions("output")

    def step_when(self, on: npt.NDArray[np.int64]) -> int:
        """The address of the program's own step (see `unrolled`) where it has one and all gates are off, else 0."""
        return 0 if on.any() else self._step

    @cached_property
    def _step(self) -> int:
        return self.functions("step").address if unrolled.unrolls(self.n, self.parameters) else 0

    def all_off(self) -> npt.NDArray[np.int64]:
        """The gate switches, all off, (gates,)."""
        return np.zeros(self.gates, dtype=np.int64)

    def rates(self, t: float, x: Array, u: Sequence[float] | Array, p: Array) -> tuple[Array, Array, Array]:
        """f, df/dx, df/dp at one point, all gates off."""
        dx, Fx, Fp = np.zeros(self.n), np.zeros((self.n, self.n)), np.zeros((self.n, self.parameters))
        self.rate(float(t), *self._vectors(x, u, p), self.all_off(), dx, Fx, Fp)
        return dx, Fx, Fp

    def outputs(self, t: float, x: Array, u: Sequence[float] | Array, p: Array) -> tuple[Array, Array, Array]:
        """h, dh/dx, dh/dp at one point, all gates off."""
        ny = self.outputs_count
        y, Hx, Hp = np.zeros(ny), np.zeros((ny, self.n)), np.zeros((ny, self.parameters))
        self.output(float(t), *self._vectors(x, u, p), self.all_off(), y, Hx, Hp)
        return y, Hx, Hp

    def _vectors(self, x: Array, u: Sequence[float] | Array, p: Array) -> tuple[Array, Array, Array]:
        """The arguments as the machine code reads them; it does not look how long they are."""
        given = (_vector(x), _vector(u), _vector(p))
        if tuple(map(len, given)) != (self.n, self.inputs, self.parameters):
            raise ValueError(
                f"expected {self.n} states, {self.inputs} inputs and {self.parameters} parameters, "
                f"got {', '.join(str(len(v)) for v in given)}"
            )
        return given


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

    def text() -> str:
        moving = [_Terms(gate.rates, gate.states) for gate in gates]
        reading = [_Terms(gate.outputs, gate.states) for gate in gates]
        layout = _Layout(names)
        rate, output = layout.blocks(rates, moving, moving=True), layout.blocks(outputs, reading, moving=False)
        functions = [native.function("rate", rate), native.function("output", output)]
        if unrolled.unrolls(len(states), len(parameters)):
            functions.append(unrolled.Step("step", len(states), len(parameters), rate[0]).text())
        return "\n".join([*lines.declared(), *functions, ""])

    every = [*rates, *outputs]
    every += [e for gate in gates for part in (gate.rates, gate.outputs, gate.states) for e in part.values()]
    kept = [[list(part) for part in (gate.rates, gate.outputs, gate.states)] for gate in gates]
    key = repr((names, len(rates), kept, _spelled(every), sympy.__version__, _generator()))
    return Program(len(states), len(inputs), len(parameters), len(outputs), len(gates), object_code.load(key, text))


@cache
def _generator() -> str:
    """A hash of the generator's own files: another one writes other code for the same model."""
    names = "codegen", "integrate", "lines", "native", "object_code", "slopes", "unrolled"
    code = (Path(__file__).with_name(f"{name}.py").read_bytes() for name in names)
    return hashlib.sha256(b"".join(code)).hexdigest()


def _spelled(expressions: Iterable[sympy.Expr]) -> str:
    """The expressions, each part once and by number after that; much faster than text for people."""
    numbers: dict[Any, int] = {}
    lines: list[str] = []

    def number(e: Any) -> int:
        if e not in numbers:
            head = type(e).__name__ if e.args else (repr(float(e)) if e.is_Float else str(e))
            lines.append(" ".join([head, *(str(number(a)) for a in e.args)]))
            numbers[e] = len(numbers)
        return numbers[e]

    tops = [number(e) for e in expressions]
    return f"{lines} {tops}"


@dataclass(frozen=True)
class _Terms:
    """A gate's part in one of the two functions: what it adds, and its states with their rates."""

    added: Mapping[int, sympy.Expr]
    states: Mapping[str, sympy.Expr]

    def all(self) -> list[sympy.Expr]:
        return [*self.added.values(), *self.states.values()]


class _Layout:
    """Where everything is read and written, by the names of states, inputs and parameters."""

    def __init__(self, names: tuple[tuple[str, ...], ...]) -> None:
        self.x, self.u, self.p = ({symbol(s): Place(j) for j, s in enumerate(group)} for group in names)
        self.slopes = Slopes()

    def blocks(self, base: Sequence[Expr], gated: Sequence[_Terms], *, moving: bool) -> list[Block]:
        """The values, their Jacobian by the state and by the parameters; the gates' states move in `rate` only."""
        own = self._owned(base, gated)
        gates = [self._gate(k, terms, own, moving) for k, terms in enumerate(gated)]
        touched = {target for gate in gates for target in gate.added}
        written: dict[Target, Expr] = {}
        for i, expression in enumerate(base):
            row = Place(i)
            written[Target("value", row)] = expression
            found = self._by_x(row, expression, self.x) | self._by_p(row, expression, lambda s: s not in own)
            # What a gate adds to starts at zero; what nobody ever writes is zero as the caller made it.
            zeros = {target: slopes.ZERO for target in touched if target.row == row and target.array != "value"}
            written |= zeros | found
        used = self._symbols([*base, *(e for terms in gated for e in terms.all())])
        read = {s: Target(a, place) for a, group in (("x", self.x), ("u", self.u), ("p", self.p))
                for s, place in group.items() if s in used and s not in own}  # fmt: skip
        return [Block(None, read, {}, written), *(gate for gate in gates if gate.added or gate.written)]

    def _gate(self, k: int, terms: _Terms, own: Mapping[sympy.Symbol, int], moving: bool) -> Block:
        """Everything that one gate adds, and what it alone writes."""
        brought = {symbol(z): Place(j, brought=True) for j, z in enumerate(terms.states)}
        mine = {s: Target("p", place) for s, place in self.p.items() if own.get(s) == k}
        added: dict[Target, Expr] = {}
        written: dict[Target, Expr] = {}
        for i, expression in terms.added.items():
            row = Place(i)
            added |= {Target("value", row): expression} if expression != 0 else {}
            added |= self._by_x(row, expression, self.x) | self._by_p(row, expression, lambda s: s not in own)
            written |= self._by_x(row, expression, brought) | self._by_p(row, expression, lambda s: s in mine)
        for row, rate in zip(brought.values(), terms.states.values() if moving else (), strict=moving):
            written[Target("value", row)] = rate
            written |= self._by_x(row, rate, {**self.x, **brought}) | self._by_p(row, rate, lambda _: True)
        return Block(k, mine | {z: Target("x", place) for z, place in brought.items()}, added, written)

    def _by_x(self, row: Place, e: Expr, places: Mapping[sympy.Symbol, Place]) -> dict[Target, Expr]:
        return self._slopes("by_x", row, e, places)

    def _by_p(self, row: Place, e: Expr, which: Callable[[sympy.Symbol], bool]) -> dict[Target, Expr]:
        return self._slopes("by_p", row, e, {s: self.p[s] for s in self.slopes.free(e) if s in self.p and which(s)})

    def _slopes(self, array: str, row: Place, e: Expr, places: Mapping[sympy.Symbol, Place]) -> dict[Target, Expr]:
        """The slopes that can differ from zero."""
        free = sorted((s for s in self.slopes.free(e) if s in places), key=lambda s: places[s].index)
        found = {Target(array, row, places[s]): self.slopes.of(e, s) for s in free}
        return {target: slope for target, slope in found.items() if slope != 0}

    def _symbols(self, expressions: Iterable[Expr]) -> set[sympy.Symbol]:
        return set().union(*map(self.slopes.free, expressions))

    def _owned(self, base: Sequence[Expr], gated: Sequence[_Terms]) -> dict[sympy.Symbol, int]:
        """Parameters that one gate alone uses, with that gate: their columns cost nothing while it is off."""
        in_base = self._symbols(base)
        users: dict[sympy.Symbol, set[int]] = {}
        for k, terms in enumerate(gated):
            for s in self._symbols(terms.all()):
                users.setdefault(s, set()).add(k)
        return {s: next(iter(users[s])) for s in self.p if s not in in_base and len(users.get(s, ())) == 1}
