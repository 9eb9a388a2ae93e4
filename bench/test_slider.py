"""A slider of the page: the free run at other values, unknown first states fitted anew, as the page asks for it."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suite.case import Case, Experiment
from suite.model import Initial, Model, Output, Parameter
from suite.model_text import to_toml
from suite.web import tasks


@pytest.mark.parametrize("estimated", [False, True], ids=["known start", "start fitted anew"])
def test_a_slider_moves_within_a_tenth_of_a_second(ratio: Any, tmp_path: Path, estimated: bool) -> None:
    """1,000 samples of an oscillator: simulated, fitted where the start is unknown, and put into the page's answer."""
    model = Model(
        name="oscillator",
        states={"p": "v", "v": "2.5*cos(t) - c*v - k*p"},
        parameters={"c": Parameter(0.3), "k": Parameter(1.0)},
        outputs={"pos": Output("p", "pos")},
        initial={name: Initial(0.0, estimate=estimated) for name in ("p", "v")},
    )
    truth = model.plus("v", "-a*p**3", {"a": Parameter(0.1)})
    record, _ = Case("slider", "", model, truth, Experiment(49.95, 0.05, (0.0, 0.0))).simulate(0.02, 1)
    assert len(record) == 1000
    data = tmp_path / "data.csv"
    np.savetxt(data, np.column_stack([record.t, record.y]), delimiter=",", header="t,pos", comments="")
    source, files, moved = to_toml(model), [(str(data), "data.csv")], count()

    def slide() -> str:
        # Every call is at another value.
        return tasks.simulate(source, files, {"k": 1.0 + 0.001 * (next(moved) % 100)}, lambda _: None)

    start = "start fitted anew" if estimated else "known start"
    ratio.alone(f"slider of the page, 1,000 samples, {start}", slide, unit="move", at_most=0.1, rounds=20)
