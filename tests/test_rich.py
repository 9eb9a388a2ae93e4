"""Displays of a notebook: well formed, escaped, and true to what they show."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from suite import plugins
from suite.discovery.result import Candidate, Coefficient, Comparison, Ledger, Named, Step, Verdict
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record, join
from suite.report.rich import model_html, record_html, sparkline, text_of
from suite.report.rich_findings import BAR, Results, ledger_html, verdict_html

MODEL = Model(
    name="a <b> & c",
    states={"p": "v", "v": "-k_1*p**3/(1 + exp(-abs(v)))"},
    parameters={
        "k_1": Parameter(2.0, sd=0.1, unit="1/s^2"),
        "m": Parameter(1.0, fixed=True),
        "c": Parameter(3.0, bounds=(0.0, math.inf)),
        "f": Parameter(0.0),
    },
    outputs={"y": Output("p", column="x<y", sigma=0.1)},
    initial={"p": Initial(1.0), "v": Initial(0.5, estimate=True)},
)
SPRING = Named("cubic_stiffness", "v", "-a*p**3", {"a": Coefficient(0.02, 0.001, "1/m^2/s^2")})
VERDICT = Verdict(
    "ambiguous", "Missing: <i>x</i>.", (SPRING,), 0.75,
    (
        Candidate((SPRING,), 0.75, 10.0, {"y": 0.1}),
        Candidate((replace(SPRING, effect="dead_zone"),), 0.25, 12.0, {"y": 0.1}, 4.2),
    ),
    {}, {}, {"before": {"y": 2.0}, "after": {"y": 0.1}, "noise": {"y": 0.1}, "held_out": {"before": {"y": 3.0},
             "after": {"y": math.inf}}},
    {"k_1": {"before": 2.0, "value": 2.1, "sd": 0.05}}, 1.0, ("Measure <more>.",),
)  # fmt: skip


def parsed(fragment: str) -> ElementTree.Element:
    """The fragment as XML; an error if a tag is left open or a sign is not escaped."""
    return ElementTree.fromstring(f"<div>{fragment.replace('<br>', '<br/>')}</div>")


@pytest.mark.parametrize("name", plugins.cases())
def test_every_cases_model_is_well_formed(name: str) -> None:
    """Whatever functions it has, its equations are MathML: one for each state, output and first state."""
    model = plugins.cases()[name].deficient
    tree = parsed(model_html(model))
    assert len(list(tree.iter("math"))) == 2 * len(model.states) + len(model.outputs) + len(model.parameters)


def test_a_model_says_how_well_its_numbers_are_known() -> None:
    """Each of the four ways to know a number has its words, and names are text."""
    said = text_of(model_html(MODEL))
    assert "a <b> & c" in said
    assert "column x<y, noise 0.1" in said
    for words in ("± 0.1", "exactly", "hardly (± 100 %), between 0 and inf", "not at all", "estimated, from 0.5"):
        assert words in said
    assert "a definition" in said


def test_a_record_shows_every_column_with_its_gaps() -> None:
    """Two runs of three columns: ranges, missing values, and a course that breaks between runs and at gaps."""
    t = np.arange(5.0)
    y = np.array([[1.0, -2.0], [2.0, np.nan], [3.0, 0.0], [4.0, 5.0], [9.0, 1.0]])
    record = join([Record(t, t[:, None], y), Record(t, t[:, None], y)])
    tree = parsed(record_html(record))
    said = text_of(record_html(record))
    assert "10 samples in 2 runs" in said
    assert "output 2 -2 5 2" in said
    courses = [path.get("d") or "" for path in tree.iter("path")]
    assert [course.count("M") for course in courses] == [2, 2, 4]


def test_a_long_column_keeps_its_spike() -> None:
    """Of 100,000 samples a single high one is still at the top of its sparkline."""
    values = np.zeros(100_000)
    values[54_321] = 7.0
    drawn = sparkline(np.arange(100_000.0), values, np.array([0, 100_000]))
    assert len(drawn) < 12_000
    assert re.search(r"L119\.5 2\.0", drawn)


def test_a_verdict_shows_weights_as_bars_and_every_error() -> None:
    """Bars are as long as the weights; a run that diverged is said to be one; text is escaped."""
    fragment = verdict_html(VERDICT)
    tree, said = parsed(fragment), text_of(fragment)
    assert [float(bar.get("width") or 0) for bar in tree.iter("rect")] == [0.75 * BAR, 0.25 * BAR]
    assert "ambiguous : Missing: <i>x</i>." in said
    assert "a = 0.02 ± 0.001 1/m^2/s^2" in said
    assert "dead_zone in v" in said
    assert "y, held out 3 diverged" in said
    assert "Measure <more>." in said


def test_a_ledger_shows_the_error_of_each_step() -> None:
    """Bars to the first step's error; green where it is noise."""
    record = Record(np.arange(4.0), np.zeros((4, 0)), np.zeros((4, 1)))
    steps = tuple(
        Step(MODEL, Comparison(record.y, np.array([0.1]), {"y": error}, {"y": 0.0}), {}, None, {}, VERDICT)
        for error in (2.0, 0.1)
    )
    ledger = Ledger(record, steps, "It fell.", ({"added": {}}, {"added": {"a": 0.02}}))
    tree, said = parsed(ledger_html(ledger)), text_of(ledger_html(ledger))
    assert "0 as given, refitted 2 1 a = 0.02 0.1" in said
    bars = [(float(bar.get("width") or 0), bar.get("fill")) for bar in tree.iter("rect")]
    assert bars == [(BAR, "#0072B2"), (0.05 * BAR, "#009E73")]


def test_results_show_the_columns_that_have_numbers() -> None:
    """With what each means; a column without a number is left out."""
    shown = Results([{"case": "a", "noise": 0.05, "estimator": "ekf", "state_nrmse": 0.123}])._repr_html_()
    parsed(shown)
    assert "RMSE of the states" in text_of(shown)
    assert "0.123" in shown
    assert "NEES" not in shown


def test_the_displays_need_no_plotting_library() -> None:
    """They are HTML by hand: importing them loads no matplotlib."""
    code = "import sys, suite.notebook; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
