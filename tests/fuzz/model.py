"""Model files: sound ones changed byte by byte, line by line, and entry by entry."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from expression import grown
from expression import strategy as equations
from hypothesis import strategies as st
from mutations import bytewise, structural, textwise
from oracle import Oracle

from suite.model_file import read_model, to_toml
from suite.web import tasks

PLANT = """name = "plant"
time = "seconds"
[states]
p = "v"
v = "(F - c*v - k*p)/m"
[parameters]
m = { value = 2.0, fixed = true, unit = "kg" }
c = { value = 0.3, sd = 0.1, bounds = [0.0, inf], unit = "N*s/m" }
k = { value = 5.0, free = true, unit = "N/m" }
tau = { value = 0.1, unit = "s" }
[inputs]
F = { column = "force", hold = "linear", delay = "tau" }
[outputs]
pos = { equation = "p", column = "x", sigma = 0.01, angle = true }
[initial]
p = { value = 0.1, estimate = true }
v = 0.0
[suspect]
equations = ["v"]
[units]
p = "m"
v = "m/s"
F = "N"
t = "s"
"""
EFFECTS = """[states]
x = "-k*x + u"
[parameters]
k = 1.0
[inputs]
u = "u"
[outputs]
x = "x"
[[effects]]
id = "magnet"
term = "-a*q**3"
roles = { q = "position" }
sentence = "a magnet"
sign = 1
forms = ["+a*q**2"]
[[effects]]
id = "lag"
equation = "x"
term = "-a*z"
coefficients = ["a"]
inner = { w = { of = "time", start = 0.1, low = 0.01, high = 1.0, tries = [1.0] } }
states = { z = { rate = "(x - z)/w", start = "0", free = true } }
dimension = "1"
family = "memory"
least = -1.0
"""
# Without units, which most equations would not agree with.
SOUND = """[states]
x = "{}"
v = "{}"
[parameters]
k = {}
c = {{ value = 0.5, sd = {} }}
[inputs]
u = "u"
[outputs]
x = "{}"
"""
SEEDS = (PLANT, EFFECTS)
KEYS = (
    "name", "time", "states", "parameters", "inputs", "outputs", "initial", "suspect", "units", "effects", "value",
    "sd", "fixed", "free", "unit", "bounds", "column", "hold", "delay", "equation", "sigma", "angle", "estimate",
    "id", "term", "roles", "inner", "forms", "sign", "least", "x", "v", "p", "F", "sin", "lambda", "of", "start",
    "low", "high",
)  # fmt: skip
UNITS = st.sampled_from(
    [
        "m",
        "furlong",
        "m^64",
        "kg m^2",
        "1e9 m",
        "m**m",
        "dB",
        "degC",
        "s^-1",
        "°",
        "(m",
        "m/0",
        "2 m",
        "m^1e9",
        "K/0",
        "%",
    ]
)
PIECES = ("[", "]", "[states]", "[[effects]]", "= ", '"', "{", "inf", "nan", "1979-05-27", "x.y = 1", "# ", "'''", "0x")


def _dumped(document: Any) -> bytes:
    try:
        return tomli_w.dumps(document).encode("utf-8", "surrogatepass")
    except (TypeError, ValueError, AttributeError):
        return b"x = ["


@st.composite
def files(draw: st.DrawFn) -> bytes:
    seed = draw(st.sampled_from(SEEDS))
    match draw(st.sampled_from(["structure", "structure", "sound", "sound", "text", "bytes", "noise", "large"])):
        case "structure":
            texts = st.one_of(equations, UNITS)
            return _dumped(draw(structural(tomllib.loads(seed), KEYS, texts)))
        case "sound":
            number = st.floats(1e-3, 1e3)
            return SOUND.format(draw(grown), draw(grown), draw(number), draw(number), draw(grown)).encode()
        case "text":
            return draw(textwise(seed, PIECES)).encode("utf-8", "surrogatepass")
        case "bytes":
            return draw(bytewise(seed.encode()))
        case "large":
            unit = draw(st.sampled_from(["[", "{a=", "a.", "[[effects]]\n", "# x\n", "x", "[a]\n", '"', "x = 1\n"]))
            return (unit * (draw(st.integers(1, 300_000)) // len(unit))).encode()
        case _:
            return draw(st.binary(max_size=200))


strategy = files()


def prepare(oracle: Oracle, folder: Path) -> Any:
    """Read a file; what is accepted is written, and read again to the same; the page shows it."""
    path, again = folder / "plant.toml", folder / "again.toml"
    for seed in SEEDS:  # loads the units and the library
        path.write_text(seed, encoding="utf-8")
        read_model(path)

    def attempt(given: bytes) -> None:
        path.write_bytes(given)
        found = oracle.check(lambda: read_model(path), given, path)
        # The page reads the same text, and looks for the line of what is wrong.
        source = given.decode("utf-8", "replace")
        oracle.check(lambda: tasks.model(source, tell=lambda _: None), given)
        if found is None:
            return
        text = oracle.check(lambda: to_toml(found), given)
        again.write_text(text, encoding="utf-8")
        if oracle.check(lambda: read_model(again), given, again) != found:
            oracle.note("a model that is not what was written", given, "")

    return attempt
