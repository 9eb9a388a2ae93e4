"""The same command gives the same numbers, to the last bit: again, in another process, by one process or by two."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from suite.__main__ import main
from suite.benchmark.store import Store

# What a run takes differs from run to run.
TAKEN = ("seconds", "step_us", "_mb", "when")
PLAN = """
cases = ["paper-cubic", "null-oscillator"]
noises = [0.02]
estimators = ["generalized-ie-discrete", "random-walk-smoother", "ukf", "enkf"]
variants = ["default"]
seeds = 2
limit = 120.0
"""


def told(rows: list[dict[str, Any]]) -> list[str]:
    """Rows as text in a fixed order, without what they took."""

    def kept(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: kept(v) for k, v in sorted(value.items()) if not any(part in k for part in TAKEN)}
        return value

    return sorted(json.dumps(kept(row)) for row in rows)


def test_a_benchmark_is_the_same_by_one_process_and_by_two(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN)
    found = []
    for jobs in ("1", "2"):
        store = tmp_path / f"{jobs}.sqlite"
        words = ["bench", "run", "--plan", str(tmp_path / "plan.toml"), "--store", str(store), "--jobs", jobs, "--json"]
        assert main(words) == 0
        with Store(store) as held:
            found.append(told(held.rows()))
    assert len(found[0]) == 16
    assert found[0] == found[1]


def test_a_verdict_is_the_same_in_another_process_and_from_an_empty_cache(tmp_path: Path) -> None:
    assert main(["example", "paper", str(tmp_path / "plant")]) == 0
    words = ["diagnose", str(tmp_path / "plant" / "model.toml"), str(tmp_path / "plant" / "data.csv"), "--json"]
    said = []
    for _ in range(2):
        environment = {**os.environ, "UNMODELLED_CACHE": str(tmp_path / "cache")}
        done = subprocess.run(
            [sys.executable, "-m", "suite", *words], env=environment, capture_output=True, text=True, check=True
        )
        verdict = json.loads(done.stdout)
        said.append(told([verdict]))
    assert said[0] == said[1]


@st.composite
def _readings(draw: st.DrawFn) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Some hundred readings of a swing in any unit, with gaps, outliers, steps, or nothing but rounding."""
    size = 10.0 ** draw(st.floats(-9.0, 9.0))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(20, 120))
    y = np.sin(0.3 * np.arange(count)) * draw(st.sampled_from([1.0, 1.0, 0.0]))
    y += draw(st.sampled_from([0.0, 1e-12, 1e-3, 1.0, 1e3])) * rng.standard_normal(count)
    y += draw(st.sampled_from([0.0, 0.0, 1e6])) * (np.arange(count) > count // 2)
    y[rng.random(count) < draw(st.sampled_from([0.0, 0.3, 0.95]))] = np.nan
    return size * y


@given(_readings())
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_a_verdict_says_is_a_number_or_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], readings: np.ndarray[Any, np.dtype[np.float64]]
) -> None:
    """No value that is not a number goes into a verdict: it is a finite number, or the data are refused in words."""
    (tmp_path / "model.toml").write_text(
        'states.p = "v"\nstates.v = "-c*v - k*p"\nparameters.c = {value = 0.1, sd = 0.05}\n'
        'parameters.k = {value = 0.1, sd = 0.02}\noutputs.y = {equation = "p", column = "y"}\n'
        "initial.p = {value = 0.0, estimate = true}\ninitial.v = {value = 0.0, estimate = true}\n"
    )
    lines = [f"{k},{'' if math.isnan(y) else repr(float(y))}" for k, y in enumerate(readings)]
    (tmp_path / "data.csv").write_text("time,y\n" + "\n".join(lines) + "\n")
    code = main(["diagnose", str(tmp_path / "model.toml"), str(tmp_path / "data.csv"), "--json"])
    out, err = capsys.readouterr()
    if code == 2:
        # The model is sound: it is the data that are refused.
        assert "data.csv" in err
        assert "Traceback" not in err
        return
    assert code == 0
    verdict = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in a verdict"))
    # A separation is of the first rivals alone (docs/verdict.md).
    assert [place for place in nothing(verdict) if not place.endswith(".separation")] == []


def nothing(value: Any, place: str = "") -> list[str]:
    """Where in a JSON value there is a null."""
    if isinstance(value, dict):
        return [found for key, entry in value.items() for found in nothing(entry, f"{place}.{key}")]
    if isinstance(value, list):
        return [found for key, entry in enumerate(value) for found in nothing(entry, f"{place}[{key}]")]
    return [place] if value is None else []
