"""The step of a small model as LLVM's text: `integrate.advance` with its loops written out, all gates off.

What the equations do not hold costs nothing here: a slope that is zero everywhere, a loop over two states, arrays that
are handed over four times a step. The arithmetic is that of `advance`, in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy

from suite.kernels.integrate import FINEST, REACH
from suite.kernels.lines import HALF, ONE, ZERO, Lines, number
from suite.kernels.native import Block

MOST_STATES = 8  # beyond this the loops are long enough
MOST_ROOM = 4096  # slopes by parameters that a step may keep

# Plain pointers and numbers go in registers: u0, u1, linear (inputs,), p (parameters,), columns (m,), x (n,),
# T (n, n + m).
ARGUMENTS = (
    "double %start, double %dt, double* %u0, double* %u1, double* %linear, double* %p, i64* %columns, i64 %m, "
    "i64 %substeps, double* %x, double* %T"
)


def unrolls(n: int, parameters: int) -> bool:
    """Whether a model of that size has a step of its own."""
    return n <= MOST_STATES and 4 * n * parameters <= MOST_ROOM


@dataclass(frozen=True)
class _Stage:
    """One of the four stages: the offset to the next one, the names of f (n,) and of F by row and column."""

    f: list[str]
    F: dict[tuple[int, int], str]


class Step(Lines):
    """The function `name`: move x over dt and write T = [dx/dx0 | dx/dp[columns]], of n states and their rates."""

    def __init__(self, name: str, n: int, parameters: int, rates: Block) -> None:
        super().__init__()
        self.name, self.n, self.read = name, n, rates.read
        self.equations = {target: e for target, e in rates.written.items() if e != 0}
        # Slopes by parameters, [parameter, stage, row]; of rows that have any.
        self.rows = sorted({target.row.index for target in self.equations if target.array == "by_p"})
        self.room = f"[{max(4 * n * parameters, 1)} x double]"
        self.begin()
        self.part()

    def text(self) -> str:
        return "\n".join([f"define void @{self.name}({ARGUMENTS}) nounwind {{\nentry:", *self.lines, "ret void", "}"])

    def begin(self) -> None:
        """T = [I | 0], and all that does not change during the step."""
        n = self.n
        self.lines.append(f"%room = alloca {self.room}")
        self.width = self.line(f"add i64 %m, {n}")
        for i in range(n):
            for j in range(n):
                self.store(ONE if i == j else ZERO, self.entry(i, str(j)))
        with _Loop(self, "clear", before="entry") as k:
            at = self.line(f"add i64 {k}, {n}")
            for i in range(n):
                self.store(ZERO, self.entry(i, at))
            column = self.load("i64", self.element("columns", k, "i64"))
            for stage in range(4):
                for row in self.rows:
                    self.store(ZERO, self.kept(column, stage, row))
        self.fixed: dict[sympy.Symbol, str] = {}
        self.driven: dict[sympy.Symbol, tuple[str, str, str]] = {}
        for s, source in self.read.items():
            if source.array == "p":
                self.fixed[s] = self.load("double", self.element("p", source.row.index))
            elif source.array == "u":
                first, last, linear = (
                    self.load("double", self.element(a, source.row.index)) for a in ("u0", "u1", "linear")
                )
                self.driven[s] = first, linear, self.operation("fsub", last, first)
        self.longest = self.operation("fdiv", "%dt", self.line("sitofp i64 %substeps to double"))
        # A step of no length, or of none that is a number, moves nothing.
        forward = self.line(f"fcmp ogt double %dt, {ZERO}")
        self.lines.append(f"br i1 {forward}, label %part, label %end")

    def part(self) -> None:
        """One part of the step; another follows while something of it is left."""
        n = self.n
        self.lines += ["part:", f"%done = phi double [{ZERO}, %clear_end], [%after, %by_parameters_end]"]
        time = self.operation("fadd", "%start", "%done")
        x = [self.load("double", self.element("x", i)) for i in range(n)]
        stages = [self.stage(0, "%done", time, x)]
        h = self.length(stages[0])
        half = self.operation("fmul", HALF, h)
        offsets = (half, half, h)
        for s, offset in enumerate(offsets, start=1):
            moved = [self.plus(xi, offset, fi) for xi, fi in zip(x, stages[-1].f, strict=True)]
            done, then = self.operation("fadd", "%done", offset), self.operation("fadd", time, offset)
            stages.append(self.stage(s, done, then, moved))
        sixth = self.operation("fdiv", h, number(6.0))
        for i in range(n):
            self.store(self.plus(x[i], sixth, self.weighted([stage.f[i] for stage in stages])), self.element("x", i))
        nothing: list[str | None] = [None] * n
        for j in range(n):
            self.column(str(j), stages, offsets, sixth, [nothing] * 4)
        with _Loop(self, "by_parameters", before="sized") as k:
            column = self.load("i64", self.element("columns", k, "i64"))
            slopes = [
                [self.load("double", self.kept(column, s, i)) if i in self.rows else None for i in range(n)]
                for s in range(4)
            ]
            self.column(self.line(f"add i64 {k}, {n}"), stages, offsets, sixth, slopes)
        self.lines.append(f"%after = fadd double %done, {h}")
        left = self.operation("fsub", "%dt", "%after")
        more = self.line(f"fcmp oge double {left}, {self.operation('fmul', number(1e-9), '%dt')}")
        self.lines += [f"br i1 {more}, label %part, label %end", "end:"]

    def stage(self, s: int, done: str, time: str, x: Sequence[str]) -> _Stage:
        """The equations at a time and a state; slopes by parameters go to the room."""
        self.values = {sympy.Symbol("t", real=True): time, **self.fixed}
        self.values |= {symbol: x[source.row.index] for symbol, source in self.read.items() if source.array == "x"}
        if self.driven:
            share = self.operation("fdiv", done, "%dt")
            for symbol, (first, linear, change) in self.driven.items():
                self.values[symbol] = self.plus(first, self.operation("fmul", linear, share), change)
        f, F = [ZERO] * self.n, {}
        for target, e in self.equations.items():
            i, value = target.row.index, self.value(e)
            if target.column is None:
                f[i] = value
            elif target.array == "by_x":
                F[i, target.column.index] = value
            else:
                self.store(value, self.kept(str(target.column.index), s, i))
        return _Stage(f, F)

    def length(self, first: _Stage) -> str:
        """How long the part is: the substep rule of `integrate`."""
        F, fastest = first.F, ZERO
        for i in range(self.n):
            row = self.call("fabs", F[i, i]) if (i, i) in F else ZERO
            for j in range(self.n):
                if i != j and (i, j) in F and (j, i) in F:
                    both = self.call("fabs", self.operation("fmul", F[i, j], F[j, i]))
                    row = self.operation("fadd", row, self.call("sqrt", both))
            fastest = self.chosen("ogt", row, fastest, row, fastest)
        left = self.operation("fsub", "%dt", "%done")
        h = self.chosen("olt", left, self.longest, left, self.longest)
        fast = self.line(f"fcmp ogt double {self.operation('fmul', h, fastest)}, {number(REACH)}")
        self.lines += ["br label %measured", "measured:", f"br i1 {fast}, label %finer, label %sized", "finer:"]
        reach, least = self.operation("fdiv", number(REACH), fastest), self.operation("fdiv", "%dt", number(FINEST))
        part = self.operation("fdiv", left, self.chosen("ogt", least, reach, least, reach))
        count = self.call("ceil", self.operation("fsub", part, number(1e-9)))
        equal = self.operation("fdiv", left, count)
        self.lines += ["br label %sized", "sized:"]
        return self.line(f"phi double [{h}, %measured], [{equal}, %finer]")

    def column(
        self, at: str, stages: Sequence[_Stage], offsets: Sequence[str], sixth: str,
        added: Sequence[Sequence[str | None]],
    ) -> None:  # fmt: skip
        """Move a column of T by its four slopes, k = F T + what is added; None is zero."""
        start = [self.load("double", self.entry(i, at)) for i in range(self.n)]
        now, slopes = start, []
        for s, stage in enumerate(stages):
            k = [self.row(stage, i, now, added[s][i]) for i in range(self.n)]
            slopes.append(k)
            if s < 3:
                now = [g if ki is None else self.plus(g, offsets[s], ki) for g, ki in zip(start, k, strict=True)]
        for i, g in enumerate(start):
            # A slope is zero at every stage or at none.
            total = [name for name in (k[i] for k in slopes) if name is not None]
            if total:
                self.store(self.plus(g, sixth, self.weighted(total)), self.entry(i, at))

    def row(self, stage: _Stage, i: int, column: Sequence[str], total: str | None) -> str | None:
        for j in range(self.n):
            if (i, j) in stage.F:
                part = self.operation("fmul", stage.F[i, j], column[j])
                total = part if total is None else self.operation("fadd", total, part)
        return total

    def weighted(self, slopes: Sequence[str]) -> str:
        """k0 + 2 k1 + 2 k2 + k3."""
        total = slopes[0]
        for slope, weight in zip(slopes[1:], (2.0, 2.0, 1.0), strict=True):
            total = self.plus(total, number(weight), slope)
        return total

    def plus(self, start: str, factor: str, slope: str) -> str:
        """Start + factor slope."""
        return self.operation("fadd", start, self.operation("fmul", factor, slope))

    def element(self, array: str, index: int | str, kind: str = "double") -> str:
        return self.line(f"getelementptr {kind}, {kind}* %{array}, i64 {index}")

    def entry(self, row: int, column: str) -> str:
        """A pointer into T."""
        return self.element("T", self.line(f"add i64 {self.line(f'mul i64 {self.width}, {row}')}, {column}"))

    def kept(self, parameter: str, stage: int, row: int) -> str:
        """A pointer into the room."""
        index = self.line(f"mul i64 {parameter}, {4 * self.n}")
        index = self.line(f"add i64 {index}, {stage * self.n + row}")
        return self.line(f"getelementptr {self.room}, {self.room}* %room, i64 0, i64 {index}")


class _Loop:
    """The lines within `with` for every j from 0 to m - 1, in one block; `before` is the block in which it begins."""

    def __init__(self, lines: Step, name: str, before: str) -> None:
        self.lines, self.name, self.before = lines.lines, name, before

    def __enter__(self) -> str:
        name, j = self.name, f"%{self.name}_j"
        self.lines += [f"br label %{name}", f"{name}:", f"{j} = phi i64 [0, %{self.before}], [{j}1, %{name}_body]"]
        self.lines += [f"{j}_more = icmp slt i64 {j}, %m", f"br i1 {j}_more, label %{name}_body, label %{name}_end"]
        self.lines.append(f"{name}_body:")
        return j

    def __exit__(self, *_: object) -> None:
        name = self.name
        self.lines += [f"%{name}_j1 = add i64 %{name}_j, 1", f"br label %{name}", f"{name}_end:"]
