"""Plans of the benchmark: their tables, rules and grids."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from hypothesis import strategies as st
from model import _dumped
from mutations import NASTY_NUMBERS, bytewise, structural, textwise, words
from oracle import Oracle

from suite import plugins
from suite.benchmark import plan

ESTIMATION = """sentence = "some"
cases = ["paper*", "null-oscillator"]
estimators = ["ekf", "ukf[alpha=0.1,1]", "oracle"]
variants = ["default", "tuned"]
noises = [0.01, 0.05]
seeds = 3
limit = 60.0
memory = 1000
exclude = ["*-hard"]
most_states = 6
tuned_at = 0.05
[[rules]]
estimators = ["u*"]
because = "slow"
seeds = 2
most_states = 4
variants = ["default"]
"""
RECOVERY = """kind = "recovery"
cases = ["null-oscillator"]
estimators = ["unmodelled"]
noises = [0.05]
seeds = 2
seeds_of = { unmodelled = 1 }
rival_variants = []
"""
SEEDS = (ESTIMATION, RECOVERY)
KEYS = (
    "sentence", "cases", "estimators", "variants", "noises", "seeds", "limit", "memory", "kind", "exclude", "tags",
    "most_states", "seeds_of", "rival_variants", "tuned_at", "rules", "because", "tuned_as",
)  # fmt: skip
keywords = st.sampled_from(["q_scale", "alpha", "beta", "x", "", "self", "a.b", "__class__"])
points = st.one_of(
    st.sampled_from(NASTY_NUMBERS), st.sampled_from(["1,2", "0.1", "a,b", ",", "1" + ",1" * 3000]), words
)
grids = st.tuples(
    st.sampled_from(["ekf", "*", "ukf", "", "[", "[!", "paper"]), st.lists(st.tuples(keywords, points), max_size=4)
).map(lambda two: f"{two[0]}[{','.join(f'{name}={values}' for name, values in two[1])}]")
patterns = st.one_of(st.sampled_from(["*", "[", "[]", "[!]", "*" * 50 + "x", "ekf", "[a-"]), words, grids)


@st.composite
def files(draw: st.DrawFn) -> bytes:
    seed = draw(st.sampled_from(SEEDS))
    match draw(st.sampled_from(["structure", "structure", "text", "bytes"])):
        case "structure":
            document = tomllib.loads(seed)
            texts = st.one_of(grids, patterns, st.lists(patterns, min_size=1, max_size=3), st.integers(-2, 10**12))
            return _dumped(draw(structural(document, KEYS, texts)))
        case "text":
            return draw(textwise(seed)).encode("utf-8", "surrogatepass")
        case _:
            return draw(bytewise(seed.encode()))


strategy = files()


def prepare(oracle: Oracle, folder: Path) -> Any:
    """Read the plan and list its cells."""
    plugins.cases(), plugins.effects(), plugins.estimators()
    plan.load("spine").cells()
    path = folder / "mine.toml"

    def attempt(given: bytes) -> None:
        path.write_bytes(given)
        oracle.check(lambda: (found := plan.load(str(path)), found.tuned_as, found.cells()), given, path)

    return attempt
