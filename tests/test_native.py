"""What is compiled from equations is what the equations say: values, slopes, gates, and what the cache keeps."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import sympy
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from suite.expressions import FUNCTIONS, parse, symbol
from suite.kernels.codegen import Gate, Program, compile_program

Array = npt.NDArray[np.float64]

NAMES = ("x", "v", "u", "a", "b")
POINT = {"x": 0.734, "v": -1.217, "u": 0.413, "a": 0.892, "b": 1.631, "t": 0.377}


def _compiled(texts: list[str], gates: tuple[Gate, ...] = (), names: tuple[str, ...] = NAMES) -> Program:
    """A program with the states x and v, whose rates and outputs are the texts."""
    parts = [parse(text, names, "test") for text in texts]
    return compile_program(
        states=("x", "v"), inputs=("u",), parameters=names[3:], rates=parts[:2], outputs=parts, gates=gates
    )


def _at(program: Program, **point: float) -> tuple[Array, Array, Array]:
    at = {**POINT, **point}
    x, u, p = (np.array([at[name] for name in group]) for group in ("xv", "u", "ab"))
    return program.outputs(at["t"], x, u, p)


def _leaf() -> st.SearchStrategy[str]:
    return st.sampled_from(["x", "v", "u", "a", "b", "t", "pi", "0.37", "2", "3"])


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Every function of the language, each within its domain."""
    free = st.tuples(st.sampled_from(["sin({})", "cos({})", "atan({})", "tanh({})", "abs({})", "sign({})", "-({})",
                                      "sqrt(1 + abs({}))", "log(1 + abs({}))", "exp(sin({}))", "asin(0.9*sin({}))",
                                      "acos(0.9*cos({}))", "tan(sin({}))", "sinh(sin({}))", "cosh(cos({}))",
                                      "1/(2 + abs({}))", "({})**2", "({})**3", "(1 + abs({}))**1.5",
                                      "1/(1 + abs({}))**2"]), inner)  # fmt: skip
    pairs = st.tuples(st.sampled_from(["({}) + ({})", "({}) - ({})", "({})*({})", "min({}, {})", "max({}, {})",
                                       "atan2({}, 3 + abs({}))", "(1.5 + sin({}))**(sin({}))"]),
                      inner, inner)  # fmt: skip
    return free.map(lambda c: c[0].format(c[1])) | pairs.map(lambda c: c[0].format(*c[1:]))


EQUATIONS = st.recursive(_leaf(), _grown, max_leaves=6)


@settings(max_examples=60, deadline=None)
@example("min(x, abs(x))")
@example("sqrt(1 + abs((1.5 + sin(pi))**(sin((1.5 + sin(x))**(sin(x))))))")
@given(EQUATIONS)
def test_values_and_slopes_are_those_of_slow_arithmetic(text: str) -> None:
    """Thirty digits and difference quotients agree with the compiled output, its Jacobian by state and parameter."""
    expression = parse(text, NAMES, "test")
    step = sympy.Float("1e-10", 40)

    def exact(**moved: sympy.Float) -> sympy.Float:
        at: Any = {symbol(name): moved.get(name, sympy.Float(value, 40)) for name, value in POINT.items()}
        return sympy.Float(expression.subs(at).evalf(40), 40)

    value = exact()
    assume(abs(value) < 1e6)
    y, Hx, Hp = _at(_compiled(["x", "v", text]))
    assert y[2] == pytest.approx(float(value), rel=1e-9, abs=1e-9)
    for name, slope in zip("xvab", [*Hx[2], *Hp[2]], strict=True):
        ends = [exact(**{name: sympy.Float(POINT[name], 40) + s * step}) for s in (1, -1)]
        difference = float((ends[0] - ends[1]) / (2 * step))
        assume(abs(difference) < 1e6)
        assert slope == pytest.approx(difference, rel=1e-6, abs=1e-7)


def test_every_function_of_the_language_has_machine_code() -> None:
    """None of the whitelist is forgotten, neither itself nor its slope."""
    for name, (count, _) in FUNCTIONS.items():
        y, Hx, _ = _at(_compiled(["x", "v", f"{name}({', '.join(['x', 'a'][:count])})"]))
        assert np.all(np.isfinite([y[2], Hx[2, 0]])), name


@pytest.mark.parametrize(
    ("text", "x", "value", "slope"),
    [
        ("sqrt(abs(x))", 0.0, 0.0, 0.0),
        ("abs(x)**b", 0.0, 0.0, 0.0),
        ("sign(x)", 0.0, 0.0, 0.0),
        ("sign(x)", math.nan, math.nan, 0.0),
        ("1/x", 0.0, math.inf, -math.inf),
        ("log(x)", 0.0, -math.inf, math.inf),
        ("log(x)", -1.0, math.nan, -1.0),
        ("sqrt(x)", -1.0, math.nan, 0.0),
        ("x**40*x**26", -1.0, 1.0, -66.0),
        ("abs(log(x))", 0.5, math.log(2.0), -2.0),
    ],
)
def test_edges_stay_what_they_are(text: str, x: float, value: float, slope: float) -> None:
    """Roots and steps have slope zero at zero; poles are infinite, and what is not a number stays so."""
    y, Hx, _ = _at(_compiled(["x", "v", text]), x=x)
    np.testing.assert_allclose([y[2], Hx[2, 0]], [value, slope], rtol=1e-14)


def _rates(program: Program, on: list[int], x: list[float], p: list[float]) -> tuple[Array, Array, Array]:
    n = len(x)
    dx, Fx, Fp = np.zeros(n), np.zeros((n, n)), np.zeros((n, len(p)))
    program.rate(0.0, np.array(x), np.zeros(1), np.array(p), np.array(on), dx, Fx, Fp)
    return dx, Fx, Fp


def test_gates_add_where_they_are_on_and_bring_their_states_to_their_place() -> None:
    """Two gates with states and one that only adds: alone, together in either order, and all off."""
    names = ("x", "v", "u", "a", "b", "c", "z", "w", "q")
    text = {
        "add": "b*x**2", "pull": "-c*z", "z": "x - b*z", "w": "q*v - w*x + a*q", "q": "w", "push": "a*w*q",
    }  # fmt: skip
    e = {key: parse(value, names, "test") for key, value in text.items()}
    gates = (
        Gate({0: e["add"]}), Gate({1: e["pull"]}, {0: e["pull"]}, {"z": e["z"]}),
        Gate({0: e["push"], 1: e["push"]}, states={"w": e["w"], "q": e["q"]}),
    )  # fmt: skip
    rates = [parse("v*a", names, "test"), parse("-x", names, "test")]
    program = compile_program(
        states=("x", "v"), inputs=("u",), parameters=("a", "b", "c"), rates=rates, outputs=rates[:1], gates=gates
    )
    values = {"x": 0.7, "v": -0.4, "a": 1.3, "b": 0.6, "c": 0.2, "z": 2.1, "w": -1.1, "q": 0.9}
    for on, brought in (([0, 0, 0], ""), ([1, 0, 0], ""), ([0, 2, 0], "z"), ([0, 0, 2], "wq"), ([1, 2, 3], "zwq"),
                        ([0, 4, 2], "wqz")):  # fmt: skip
        whole = list(rates) + [e[z] for z in brought]
        for k, gate in enumerate(gates):
            for i, added in gate.rates.items():
                whole[i] = whole[i] + (added if on[k] else 0)
        order = ["x", "v", *brought]
        found = _rates(program, on, [values[z] for z in order], [values[name] for name in "abc"])
        at: Any = {symbol(name): value for name, value in values.items()}
        numbers: list[Any] = [[float(f.subs(at)) for f in whole]]
        for group in (order, "abc"):
            numbers.append([[float(f.diff(symbol(s)).subs(at)) for s in group] for f in whole])
        for got, wanted in zip(found, numbers, strict=True):
            np.testing.assert_allclose(got, wanted, rtol=1e-13, atol=1e-15)


CODE = """
import numpy as np
from suite.model import Model, Output
model = Model("m", {"x": "-x**3 + sign(x)"}, outputs={"y": Output("2*x", "y")})
print(model.rate(0.0, np.full(1, 2.0))[0], model.output(0.0, np.ones(1))[0])
"""


def _run(folder: Path) -> str:
    environment = {**os.environ, "UNMODELLED_CACHE": str(folder)}
    return subprocess.run(
        [sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_a_broken_file_in_the_cache_is_compiled_anew(tmp_path: Path) -> None:
    """Cut, emptied or overwritten: the numbers are right, and the file is whole again."""
    assert _run(tmp_path) == "-7.0 2.0\n"
    (path,) = tmp_path.glob("model_*.o")
    whole = path.read_bytes()
    for broken in (whole[: len(whole) // 2], b"", whole[:200] + b"\xff" + whole[201:], b"text"):
        path.write_bytes(broken)
        assert _run(tmp_path) == "-7.0 2.0\n"
        assert path.read_bytes()[:4] == whole[:4]
        assert len(path.read_bytes()) == len(whole)


def test_a_forked_process_can_use_and_compile_programs(tmp_path: Path) -> None:
    """What the parent has loaded works in the child, and the child compiles more."""
    code = CODE + (
        "import multiprocessing\n"
        "def work(k):\n"
        "    other = Model('o', {'x': f'-{k}*x'}, outputs={'y': Output('x', 'y')})\n"
        "    return float(model.rate(0.0, np.full(1, 2.0))[0] + other.rate(0.0, np.ones(1))[0])\n"
        "with multiprocessing.get_context('fork').Pool(2) as pool:\n"
        "    print(pool.map(work, [3, 4, 3, 4]))\n"
    )
    environment = {**os.environ, "UNMODELLED_CACHE": str(tmp_path)}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout == "-7.0 2.0\n[-10.0, -11.0, -10.0, -11.0]\n"
