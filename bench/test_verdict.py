"""A full verdict on 500 samples: warm in one process, in a fresh process, and in the first one ever on a machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suite import plugins
from suite.case import Case, Experiment
from suite.discovery.verdict import diagnose
from suite.model import Initial, Model, Output, Parameter
from suite.model_text import to_toml
from suite.record import Record

SPRING = Model(
    name="oscillator",
    states={"p": "v", "v": "2.5*cos(t) - c*v - k*p"},
    parameters={"c": Parameter(0.3, sd=0.02), "k": Parameter(1.0, sd=0.05)},
    outputs={"pos": Output("p", "pos")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)


@pytest.fixture(scope="module")
def record() -> Record:
    """500 samples of the oscillator with a cubic spring, 2 % noise."""
    truth = SPRING.plus("v", "-a*p**3", {"a": Parameter(0.1)})
    return Case("verdict", "", SPRING, truth, Experiment(24.95, 0.05, (0.0, 0.0))).simulate(0.02, 1)[0]


@pytest.fixture(scope="module")
def command(record: Record, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """`unmodelled diagnose` of that record as a command."""
    folder = tmp_path_factory.mktemp("verdict")
    model, data = folder / "model.toml", folder / "data.csv"
    model.write_text(to_toml(SPRING), encoding="utf-8")
    np.savetxt(data, np.column_stack([record.t, record.y]), delimiter=",", header="t,pos", comments="")
    return [sys.executable, "-m", "suite", "diagnose", str(model), str(data), "--json"]


def _run(command: list[str], **environment: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, **environment})
    assert json.loads(done.stdout)["effects"][0]["effect"] == "cubic_stiffness"


def test_a_warm_verdict(record: Record, ratio: Any) -> None:
    """At most a second where everything is loaded, as on the page."""
    effects = plugins.effects()
    assert diagnose(SPRING, record, effects).effects[0].effect == "cubic_stiffness"
    ratio.alone(
        "full verdict, 500 samples, warm", lambda: diagnose(SPRING, record, effects), unit="verdict", at_most=1.0
    )


def test_a_verdict_in_a_fresh_process(command: list[str], ratio: Any) -> None:
    """At most 4 s from the command line, with what an earlier run left in the cache."""
    ratio.alone(
        "full verdict, 500 samples, fresh process", lambda: _run(command), unit="command", at_most=4.0, command=True
    )


def test_the_first_verdict_on_a_machine(command: list[str], ratio: Any, tmp_path: Path) -> None:
    """At most a minute where nothing was ever compiled."""
    cache = str(tmp_path)
    ratio.alone(
        "full verdict, 500 samples, first run on a machine", lambda: _run(command, UNMODELLED_CACHE=cache),
        unit="command", at_most=60.0, rounds=1, command=True, warm=False,
    )  # fmt: skip
