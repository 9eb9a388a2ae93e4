"""`bench table1`: what better methods reach on the plant of Table 1, and that a failure stands in its place."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from suite.__main__ import main
from suite.benchmark import better, table_one
from suite.benchmark.table_one import TRUE_A3
from suite.benchmark.worker import Failure
from suite.record import Record
from suite.report import table_one_figures

LIKELIHOOD = "maximum likelihood after adding the term"
BOUND = "Cramer-Rao bound (sd)"


@dataclass(frozen=True)
class Page:
    """The folder that the command has written, and the numbers in it by method, measured states and noise."""

    folder: Path
    a3: dict[tuple[str, tuple[str, ...], float], float]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """The command as a user gives it, with one seed."""
    folder = tmp_path_factory.mktemp("table1")
    assert main(["bench", "table1", "--seeds", "1", "-o", str(folder)]) == 0
    rows: list[dict[str, Any]] = json.loads((folder / "table1.json").read_text(encoding="utf-8"))["methods"]
    assert [row["reason"] for row in rows] == [""] * len(rows)
    return Page(folder, {(row["method"], tuple(row["measured"]), row["noise"]): row["a3"][0] for row in rows})


def test_every_method_has_a_number_for_every_noise(page: Page) -> None:
    """No cell of the comparison is empty, in JSON and on the page."""
    wanted = {(m, s, n) for m in (*better.METHODS, BOUND) for s in better.MEASURED for n in better.NOISES}
    assert set(page.a3) == wanted
    lines = (page.folder / "table1.md").read_text(encoding="utf-8").splitlines()
    for method in better.METHODS:
        found = [line for line in lines if line.startswith(f"| {method} ")]
        assert len(found) == len(better.MEASURED)
        assert all(line.count(" +- ") == len(better.NOISES) for line in found)


def test_likelihood_reaches_the_bound_and_the_bound_is_one(page: Page) -> None:
    """The refit is within three bounds of the truth; the bound is linear in the noise, and falls with what is seen."""
    both, one = better.MEASURED
    for measured in better.MEASURED:
        for noise in better.NOISES:
            bound = page.a3[BOUND, measured, noise]
            assert abs(page.a3[LIKELIHOOD, measured, noise] - TRUE_A3) < 3.0 * bound
            assert bound == pytest.approx(noise * page.a3[BOUND, measured, 0.1] / 0.1, rel=1e-9)
    assert page.a3[BOUND, both, 0.1] < page.a3[BOUND, one, 0.1]


def test_a_regression_on_d_falls_short_more_and_more(page: Page) -> None:
    """The note on the page: the estimators' first look is nearest at little noise, and never beyond the truth."""
    for measured in better.MEASURED:
        short = [TRUE_A3 - page.a3["invariant embedding, likelihood-tuned", measured, noise] for noise in better.NOISES]
        assert short[0] > 0.0
        assert short == sorted(short)


def test_the_pictures_are_whole(page: Page) -> None:
    """Each names what it shows: the estimates with their a3 in Figure 1, every method in the comparison."""
    for name, words in (
        ("figure-1", ("conventional, alpha = 1", "generalized, alpha", "time [s]")),
        ("a3-by-method", tuple(better.METHODS)),
    ):
        path = page.folder / f"{name}.svg"
        assert ElementTree.parse(path).getroot().tag.endswith("svg")
        text = path.read_text(encoding="utf-8")
        assert [word for word in words if word not in text] == []


def test_a_method_that_fails_leaves_its_reason(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In the row of the method, in place of numbers, and as a gap in the picture; the others stand."""

    def fails(*_: Any) -> float:
        raise ArithmeticError("no such luck")

    monkeypatch.setattr(better, "METHODS", {"sound": lambda *_: 0.02, "broken": fails})
    found = better.one(("x1", "x2"), 0.1, 0)
    assert found == {"sound": 0.02, "broken": "ArithmeticError: no such luck"}
    killed = Failure("error", "killed by signal 9")
    entries = [
        better._entry(method, measured, 0.1, runs)
        for measured in better.MEASURED
        for method, runs in (("sound", [found, found]), ("broken", [found]), ("lost", [killed]))
    ]
    assert [entry.text for entry in entries[:3]] == ["200.0 +- 0.0", "-", "-"]
    assert [entry.reason for entry in entries[:3]] == ["", "ArithmeticError: no such luck", killed.reason]
    bounds = [better.Entry(BOUND, measured, 0.1, (0.001,)) for measured in better.MEASURED]
    rows = better.cells([*entries, *bounds], ("x2",))
    assert rows[1:] == [["sound", "200.0 +- 0.0"], ["broken", "-"], ["lost", "-"], [BOUND, "10.0"]]
    for path in table_one_figures.comparison([*entries, *bounds], tmp_path):
        assert path.stat().st_size > 1000


def test_the_spread_is_that_of_a_sample() -> None:
    """Mean and standard deviation with n - 1, in 1e-4, in the order in which the seeds were run."""
    values = (0.0190, 0.0195, 0.0206)
    text = better.Entry("any", ("x1",), 0.1, values).text
    assert text == f"{1e4 * np.mean(values):.1f} +- {1e4 * np.std(values, ddof=1):.1f}"


def test_a_held_sample_is_the_mean_over_its_step() -> None:
    """Times rise from each sample to just before the next; of a line within each step, the mean is that of its ends."""
    record = Record(np.array([0.0, 0.5, 2.0]), np.zeros((3, 0)), np.array([[1.0], [2.0], [9.0]]))
    held = table_one._held(record)
    assert np.all(np.diff(held.t) > 0)
    assert held.t[[0, -1]] == pytest.approx([0.0, 0.5 + 0.999 * 1.5])
    assert held.y[held.t < 0.5].tolist() == [[1.0]] * (len(held) // 2)
    assert held.y[held.t >= 0.5].tolist() == [[2.0]] * (len(held) // 2)
    assert table_one._hold_means(held.t[:, None]).ravel() == pytest.approx([0.999 * 0.25, 0.5 + 0.999 * 0.75])
