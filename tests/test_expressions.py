"""Equations are text that is translated, never run."""

from __future__ import annotations

import math

import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from suite import expressions
from suite.errors import ModelError
from suite.expressions import parse, plain, symbol

NAMES = ("x", "v", "a")
WHERE = "plant.toml, [states] v"

HOSTILE = {
    "import": "__import__('os').system('x')",
    "attribute": "x.real",
    "dunder": "().__class__.__bases__",
    "tower of numbers": "9**9**9",
    "tower": "2**" * 40 + "2",
    "long tower": "2**" * 3_000_000 + "2",
    "power of powers": "(" * 40 + "9*x" + ")**64" * 40,
    "brackets": "(" * 100_000 + "x" + ")" * 100_000,
    "brackets within the length": "(" * 4_900 + "x" + ")" * 4_900,
    "signs": "-" * 9_000 + "x",
    "bracketed signs": "-(-" * 2_000 + "x" + ")" * 2_000,
    "not": "not " * 2_000 + "x",
    "nested abs": "abs(x-" * 90 + "v" + ")" * 90,
    "nested sin": "sin(x+" * 90 + "v" + ")" * 90,
    "continued fraction": "1/(x+" * 90 + "v" + ")" * 90,
    "lambda": "lambda: x",
    "comprehension": "[x for x in (1, 2)]",
    "f-string": "f'{x}'",
    "string": "'x'",
    "keyword argument": "sin(x=1)",
    "starred": "sin(*x)",
    "double starred": "sin(**x)",
    "subscript": "x[0]",
    "conditional": "x if v else a",
    "comparison": "x < v",
    "logic": "x and v",
    "walrus": "(x := 1)",
    "invert": "~x",
    "floor division": "x//v",
    "modulo": "x%v",
    "matrix product": "x@v",
    "tuple": "x, v",
    "two statements": "x; v",
    "statement": "import os",
    "await": "await x",
    "complex": "1j*x",
    "true": "True",
    "none": "None",
    "ellipsis": "...",
    "null": "x\x00",
    "comment": "x # + v",
    "too large a number": "1e400",
    "huge whole number": "*".join(["9007199254740991"] * 400),
    "division by zero": "x/(2 - 2)",
    "root of a negative": "sqrt(-1)",
    "a negative base": "(-1)**x",
    "root of what is never positive": "max(sqrt(-2*x*x), v)",
    "power of what is never positive": "(-0.9*exp(x))**1.26",
    "a base of zero": "(v - v)**x",
    "unknown function": "eval(x)",
    "a function's name alone": "sin",
    "argument count": "sin(x, v)",
    "undeclared": "q*x",
    "empty": "  ",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
def test_everything_outside_the_language_is_refused_by_place(text: str) -> None:
    """Hostile text ends in one sentence that names the place."""
    with pytest.raises(ModelError) as refusal:
        parse(text, NAMES, WHERE)
    sentence = str(refusal.value)
    assert sentence.startswith(WHERE)
    assert len(sentence) < 400
    assert "\n" not in sentence


@pytest.mark.parametrize("text", [None, 3, 1.5, b"x", ["x"]])
def test_only_text_is_an_equation(text: object) -> None:
    """A number or a list where an equation should be is refused, not converted."""
    with pytest.raises(ModelError, match="expected an equation as text"):
        parse(text, NAMES, WHERE)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-x**2", -9.0),
        ("(-x)**2", 9.0),
        ("2**-1", 0.5),
        ("x^2", 9.0),
        ("x**-v**2", 3.0**-4.0),
        ("2**3**2", 512.0),
        ("x - v - a", 0.5),
        ("x/v/a", 3.0),
        ("x/v*a", 0.75),
        ("abs(-x)**0.5", math.sqrt(3.0)),
        ("min(x, max(v, 5))", 3.0),
        ("sign(-v) + sign(0)", -1.0),
        ("atan2(-x, -v)", math.atan2(-3.0, -2.0)),
        ("1_000*x", 3000.0),
        ("x +\n   v", 5.0),
        ("x" + " " * 500 + "+ v", 5.0),
        ("--x", 3.0),
        ("pi*t", 7.0 * math.pi),
        ("(2*x)**64", 6.0**64),
        ("1e-320*x", 3e-320),
        ("0.1 + 0.2", 0.1 + 0.2),
    ],
)
def test_the_language_means_what_mathematics_means(text: str, value: float) -> None:
    """Precedence, signs and functions give the numbers of a textbook."""
    expression = parse(text, NAMES, WHERE)
    assert _at(expression, x=3.0, v=2.0, a=0.5, t=7.0) == pytest.approx(value, rel=1e-14)


def test_long_equations_that_are_not_deep_are_read() -> None:
    """A polynomial with hundreds of powers is not a power tower."""
    text = " + ".join(f"a*x**{1 + k % 60}*v**{k % 7}" for k in range(300))
    assert text.count("**") > 500
    assert _at(parse(text, NAMES, WHERE), x=1.0, v=1.0, a=2.0) == pytest.approx(600.0)


def test_a_state_may_carry_the_name_of_a_constant_of_sympy() -> None:
    """E, I, S and pi's relatives are ordinary names here."""
    expression = parse("E*I + S*N", ("E", "I", "S", "N"), WHERE)
    assert expression.free_symbols == {symbol(name) for name in "EISN"}


def test_three_way_extrema_come_back_as_text_that_parses() -> None:
    """Nested max is merged by sympy; the text still has two arguments at a time."""
    expression = parse("max(max(x, v), max(a, 1))", NAMES, WHERE)
    assert parse(plain(expression), NAMES, WHERE) == expression


def _leaf() -> st.SearchStrategy[str]:
    numbers = st.floats(0.01, 100.0).map(lambda value: repr(value)) | st.integers(1, 50).map(str)
    return st.sampled_from(["x", "v", "a", "t", "pi"]) | numbers


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    binary = st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda part: f"({part[0]} {part[1]} {part[2]})")
    ratio = st.tuples(inner, inner).map(lambda part: f"{part[0]}/(1 + abs({part[1]}))")
    power = st.tuples(inner, st.integers(1, 4)).map(lambda part: f"({part[0]})**{part[1]}")
    root = inner.map(lambda part: f"sqrt(abs({part}))")
    single = st.tuples(st.sampled_from(["sin", "cos", "tanh", "atan", "abs", "sign"]), inner)
    double = st.tuples(st.sampled_from(["min", "max", "atan2"]), inner, inner)
    return (
        binary
        | ratio
        | power
        | root
        | inner.map(lambda part: f"-{part}")
        | single.map(lambda part: f"{part[0]}({part[1]})")
        | double.map(lambda part: f"{part[0]}({part[1]}, {part[2]})")
    )


EQUATIONS = st.recursive(_leaf(), _grown, max_leaves=8)


@settings(max_examples=60, deadline=None)
@given(EQUATIONS, st.floats(0.1, 2.0), st.floats(-2.0, -0.1))
def test_an_equation_survives_the_way_to_text_and_back(text: str, x: float, v: float) -> None:
    """plain() writes what parse() reads: the numbers agree."""
    refused = ""
    try:
        expression = parse(text, NAMES, WHERE)
    except ModelError as error:
        refused = str(error)
    if refused:
        # The generator can write constants that are out of range.
        assert "constant" in refused or "exponent" in refused
        return
    again = parse(plain(expression), NAMES, WHERE)
    point = {"x": x, "v": v, "a": 0.7, "t": 1.3}
    first, second = _at(expression, **point), _at(again, **point)
    # A step function may fall on either side where its argument cancels to zero.
    assert first == pytest.approx(second, rel=1e-9, abs=1e-9) or "sign" in text or "atan2" in text


def test_reserved_names_are_the_functions_the_constants_and_time() -> None:
    """What the language uses cannot be declared."""
    assert {"sin", "atan2", "pi", "t"} <= expressions.RESERVED


def _at(expression: sympy.Expr, **values: float) -> float:
    return float(expression.evalf(30, subs={symbol(name): value for name, value in values.items()}))
