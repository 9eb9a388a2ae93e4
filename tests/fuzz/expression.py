"""Equations: sentences of the model language, near misses, and what Python would evaluate."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st
from mutations import NASTY_NUMBERS, words
from oracle import Oracle

from suite import expressions

NAMES = ("x", "v", "k", "c", "u", "t", "pi")
PYTHON = (
    "__import__('fuzz_canary').x", "fuzz_canary()", "fuzz_canary.x", "x.__class__", "[x for x in (1,)]",
    "(lambda: x)()", "f'{fuzz_canary.x}'", "x if x else v", "x := 1", "print(x)", "x[0]", "{x: v}", "x and v",
    "not x", "x < v", "*x", "await x", "yield x", "...", "None", "True", "1j", "b'a'", "'a'", "x @ v", "x // v",
    "x % v", "x << v", "~x", "x | v", "sin(x=1)", "sin(*x)", "sin(**x)", "sin", "sin()", "min(x)", "x;v", "x=1",
    "import os", "x\\\nv", "((((", "))",
)  # fmt: skip


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**", "^", ",", " "]), inner).map("".join),
        inner.map(lambda text: f"({text})"),
        inner.map(lambda text: f"-{text}"),
        st.tuples(st.sampled_from(sorted(expressions.FUNCTIONS)), inner).map(lambda two: f"{two[0]}({two[1]})"),
        st.tuples(st.sampled_from(["min", "max", "atan2"]), inner, inner).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
    )


leaves = st.one_of(
    st.sampled_from(NAMES),
    st.integers(0, 70).map(str),
    st.floats(allow_nan=False).map(repr),
    st.sampled_from(NASTY_NUMBERS),
    st.sampled_from(PYTHON),
    words,
)
sound = st.one_of(st.sampled_from(NAMES), st.integers(0, 9).map(str), st.floats(0.001, 1e3).map(repr))
repeated = st.tuples(
    st.sampled_from(
        ["(", "-", "x**", "sin(", "x+", "x*", "1/(1+", "[", "abs(", "exp(", "x-(", "min(x,", "2**", "x^2*"]
    ),
    st.integers(1, 12_000),
    st.sampled_from(["", "x", "1"]),
    st.sampled_from(["", ")"]),
).map(lambda parts: parts[0] * (parts[1] // len(parts[0])) + parts[2] + parts[3] * (parts[1] // len(parts[0])))
grown = st.recursive(sound, _grown, max_leaves=25)
strategy = st.one_of(grown, st.recursive(leaves, _grown, max_leaves=12), repeated, st.text())


def prepare(oracle: Oracle, folder: Any) -> Any:
    """Read an equation; what is accepted is printed, and its print read again to the same."""
    known = frozenset(NAMES) - {"t", "pi"}

    def read(text: str) -> None:
        expression = expressions.parse(text, known, "fuzz, [states] x")
        expressions.latex(expression)
        expressions.plain(expression)

    return lambda text: oracle.check(lambda: read(text), text)
