"""The report is one small file that needs no network, shows every spike, and lets no name become markup."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from suite.discovery.result import Candidate, Coefficient, Comparison, Discrepancy, Ledger, Named, Step, Verdict
from suite.errors import InputError
from suite.model import Input, Model, Output, Parameter
from suite.record import Record
from suite.report import failure, figures
from suite.report.canvas import thinned, timeline
from suite.report.page import write_figures, write_report
from suite.report.vector import svg

HOSTILE = '<script>alert("x")</script>&$a_b$'


def oscillator(output: str = "pos") -> Model:
    return Model(
        name="driven oscillator",
        states={"p": "v", "v": "(F - c*v - k*p)/m"},
        parameters={"m": Parameter(1.3, fixed=True, unit="kg"), "c": Parameter(0.5, sd=0.1), "k": Parameter(8.0)},
        inputs={"F": Input("force")},
        outputs={output: Output("p", "pos")},
        time="seconds",
    )


def ledger(N: int = 1200, model: Model | None = None, runs: int = 1) -> Ledger:
    """Two steps of a loop on a plant that lacks a cubic spring, written by hand."""
    before = model or oscillator()
    (output,) = before.outputs
    after = before.plus("v", "-a*p**3", {"a": Parameter(2.1, unit="1/(m^2 s^2)")})
    noise = np.random.default_rng(7)
    t = np.linspace(0.0, 30.0, N)
    p = 1.1 * np.sin(2.1 * t) * (0.6 + 0.4 * np.sin(0.23 * t))
    v = np.gradient(p, t)
    y = p + 0.02 * noise.standard_normal(N)
    starts = tuple(int(k * N / runs) for k in range(runs))
    record = Record(t, np.sin(2.1 * t)[:, None], y[:, None], starts, source="oscillator.csv")
    sigma = np.array([0.02])
    worse = Comparison(
        Y=(p + 0.25 * p**3 * np.sin(0.6 * t))[:, None],
        sigma=sigma,
        error={output: 0.118},
        fit={output: 81.4},
        worst=((0, 5.1, 6.3), (0, 8.2, 9.0)),
        sentence="The model fails for |p| > 0.8, in every cycle.",
    )
    good = Comparison(Y=p[:, None], sigma=sigma, error={output: 0.0203}, fit={output: 97.1})
    d = -2.1 * p**3
    wander = 0.15 * np.sin(1.3 * t) + 0.1 * noise.standard_normal(N)
    misfit = Discrepancy(
        x=np.column_stack([p, v]),
        d=np.column_stack([np.zeros(N), d + wander]),
        d_sd=np.column_stack([np.zeros(N), np.full(N, 0.22)]),
        equation="v",
        variable="p",
        ratio=0.87,
    )
    cubic = Named("cubic_stiffness", "v", "-a*p**3", {"a": Coefficient(2.1, 0.08, "1/(m^2 s^2)")})
    quintic = Named("quintic_stiffness", "v", "-a*p**5", {"a": Coefficient(1.74, 0.11)})
    zone = Named(
        "dead_zone", "v", "-a*max(abs(p) - w, 0)*sign(p)", {"a": Coefficient(4, 1), "w": Coefficient(0.41, 0.2)}
    )
    drag = Named("quadratic_drag", "v", "-a*v*abs(v)", {"a": Coefficient(0.02, 0.01)})
    verdict = Verdict(
        verdict="missing_effect",
        sentence="Cubic stiffness is missing in the equation of v (weight 0.93).",
        effects=(cubic,),
        weight=0.93,
        plausible=(
            Candidate((cubic,), 0.93, -5210.0, {output: 0.0203}, None, d),
            Candidate((quintic,), 0.05, -5204.1, {output: 0.0211}, 9.4),
            Candidate((zone, drag), 0.02, -5202.0, {output: 0.0216}, 31.0),
        ),
        detection={"lambda": 812.0, "threshold": 9.0, "ljung_box_p": 1e-12},
        smallest_detectable={"cubic_stiffness": 0.06},
        error={},
        parameters={"k": {"before": 8.0, "value": 7.43, "sd": 0.05}, "c": {"before": 0.5, "value": 0.512, "sd": 0.02}},
        seconds=1.2,
        advice=("Drive the plant to |p| of 1.6: the separation of quintic stiffness then rises to 40.",),
    )
    adequate = replace(
        verdict,
        verdict="adequate",
        sentence="Nothing is missing that these data show.",
        plausible=(),
        advice=(),
        effects=(),
    )
    lags = np.arange(1, 31)
    ringing = {output: 0.8 * np.cos(0.35 * lags) * np.exp(-lags / 25)}
    white = {output: noise.standard_normal(30) / np.sqrt(N)}
    return Ledger(
        record=record,
        steps=(
            Step(before, worse, {output: 0.131}, misfit, ringing, verdict),
            Step(after, good, {output: 0.0209}, None, white, adequate),
        ),
        sentence="Cubic stiffness was missing in the equation of v; with it the error falls to the noise.",
        history=(
            {"step": 0, "change": "as given", "error": {output: 0.118}, "verdict": "missing_effect"},
            {
                "step": 1,
                "change": "+ cubic_stiffness in v",
                "error": {output: 0.0203},
                "verdict": "adequate",
                "note": None,
            },
        ),
    )


class Outline(HTMLParser):
    """Tags, headings and whatever a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name in {"src", "href", "xlink:href", "data", "srcset"} and value and not value.startswith("#"):
                self.fetched.append(value)


def outline(text: str) -> Outline:
    parser = Outline()
    parser.feed(text)
    return parser


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(ledger(), path, command="unmodelled discover model.toml data.csv -o found", date="2026-01-02")
    return path.read_text(encoding="utf-8")


def test_self_contained(page: str) -> None:
    """Nothing is fetched and nothing runs: the only addresses are names of XML namespaces."""
    found = outline(page)
    assert not found.fetched
    assert not {"script", "link", "iframe", "object", "img"} & set(found.tags)
    assert "url(" not in re.sub(r"url\(#[\w-]+\)", "", page)
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", page).replace("http-equiv", "")


def test_says_what_was_found(page: str) -> None:
    """Verdict, amended term, coefficient with its sd, look-alike, advice, command and date can all be read."""
    for text in (
        "Cubic stiffness was missing in the equation of v;",
        "<mark> - a*p**3</mark>",
        "a = 2.10 ± 0.08 1/(m^2 s^2)",
        "Quintic stiffness in v fits nearly as well",
        "Drive the plant to |p| of 1.6",
        "7.43 ± 0.05",
        "unmodelled discover model.toml data.csv -o found",
        "2026-01-02",
    ):
        assert text in page


def test_headings_in_order(page: str) -> None:
    """There is one h1, and no heading skips a level."""
    levels = [int(tag[1]) for tag in outline(page).tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in zip([0, *levels], levels, strict=False))


def test_ids_are_unique(page: str) -> None:
    """Several figures stand in one page without sharing an id, and every reference finds its target."""
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:href="#|url\(#)([\w.-]+)', page)) <= set(ids)


def test_large_records_make_small_pages(tmp_path: Path) -> None:
    """131,072 samples still give a page below 2 MB."""
    path = write_report(ledger(131_072), tmp_path / "report.html")
    assert path.stat().st_size < 2_000_000


def test_spikes_survive_thinning() -> None:
    """A single outlier among 131,072 samples is drawn, whichever way it points; what is missing does not hide it."""
    y = np.random.default_rng(3).standard_normal(131_072)
    y[::7] = np.nan
    y[70_001], y[90_002] = 50.0, -50.0
    kept = thinned(y)
    assert len(kept) <= 4000
    assert np.all(np.diff(kept) > 0)
    assert {70_001, 90_002} <= set(kept.tolist())
    assert len(thinned(y[:4000])) == 4000


def test_hostile_names_stay_text(tmp_path: Path) -> None:
    """Markup in names, sentences and commands arrives as text in the page and in its figures."""
    hostile = replace(oscillator(HOSTILE), name=HOSTILE)
    found = replace(ledger(60, hostile), sentence=HOSTILE, history=({HOSTILE: HOSTILE},))
    found = replace(found, record=replace(found.record, source=HOSTILE))
    text = write_report(found, tmp_path / "report.html", command=HOSTILE).read_text(encoding="utf-8")
    assert "script" not in outline(text).tags
    assert "&lt;script&gt;" in text


def test_figures_speak(tmp_path: Path) -> None:
    """Each SVG file is well-formed and has a title, a description and a role for those who listen."""
    files = write_figures(ledger(60), tmp_path)
    assert {"waterfall.svg", "step0-compare.svg", "step0-discrepancy.svg", "step0-map.svg"} <= {f.name for f in files}
    space = "{http://www.w3.org/2000/svg}"
    for file in files:
        root = ElementTree.fromstring(file.read_text(encoding="utf-8"))
        assert root.get("role") == "img"
        for tag in ("title", "desc"):
            assert (root.findtext(space + tag) or "").strip()
        assert root.get("aria-label") == root.findtext(space + "title")


def test_figures_are_reproducible() -> None:
    """The same ledger gives the same bytes."""
    assert svg(figures.waterfall(ledger(60))) == svg(figures.waterfall(ledger(60)))


def test_failed_write_leaves_the_old_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """When writing fails the report of before is still whole, and nothing lies beside it."""
    path = tmp_path / "report.html"
    path.write_text("the old report")

    def refuse(source: str, target: Path) -> None:
        raise OSError(28, "no space left")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(InputError, match="no space left"):
        write_report(replace(ledger(60), steps=ledger(60).steps[1:]), path)
    assert path.read_text() == "the old report"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_runs_stand_apart() -> None:
    """Several runs whose clocks overlap are drawn one after another with a gap."""
    record = Record(np.array([0.0, 1.0, 2.0, 0.0, 1.0]), np.zeros((5, 0)), np.zeros((5, 1)), (0, 3))
    at, offsets = timeline(record)
    assert np.all(np.diff(at) > 0)
    assert at[3] > 2.0
    assert offsets[0] == 0.0
    found = ledger(runs=3)
    fig = figures.compare(found.steps[0].model, found.record, found.steps[0].comparison)
    assert fig.axes[-1].get_xlabel() == "time (seconds), 3 runs one after another"


def test_little_is_enough() -> None:
    """A single state, no candidate, no held-out data and missing samples still give figures."""
    model = Model("mug", {"T": "-k*T"}, {"k": Parameter(0.1)}, outputs={"T_probe": Output("T", "T", angle=True)})
    t = np.linspace(0, 9, 40)
    y = np.exp(-t)[:, None]
    y[5:9] = np.nan
    record = Record(t, np.zeros((40, 0)), y)
    comparison = Comparison(np.exp(-t)[:, None], np.array([0.0]), {"T_probe": 0.1}, {"T_probe": 90.0})
    misfit = Discrepancy(np.exp(-t)[:, None], np.zeros((40, 1)), np.zeros((40, 1)), "T", "t", 0.1)
    found = Ledger(record, (Step(model, comparison, {}, misfit, {}, None),), "Nothing can be said.")
    assert failure.state_map(model, misfit) is None
    drawn = [figures.waterfall(found), figures.compare(model, record, comparison)]
    for fig in (*drawn, failure.discrepancy(model, record, misfit)):
        assert "<title>" in svg(fig)


def test_divergence_is_drawn() -> None:
    """A simulation that runs away to infinity hides neither the measurements nor the other steps."""
    found = ledger(300)
    away = found.steps[0].comparison.Y.copy()
    away[150:200], away[200:] = 1e90, np.inf
    comparison = replace(found.steps[0].comparison, Y=away, error={"pos": np.inf}, fit={"pos": -np.inf})
    steps = (replace(found.steps[0], comparison=comparison), found.steps[1])
    fig = figures.compare(steps[0].model, found.record, comparison)
    low, high = fig.axes[0].get_ylim()
    assert -5 < low < found.record.y.min() < found.record.y.max() < high < 5
    assert "<title>" in svg(fig)
    assert "<title>" in svg(figures.waterfall(replace(found, steps=steps)))
    steep = replace(found.steps[0], comparison=replace(found.steps[0].comparison, error={"pos": 5.0}))
    fig = figures.waterfall(replace(found, steps=(steep, found.steps[1])))
    assert {"0.01", "0.1", "1"} <= {label.get_text() for label in fig.axes[0].get_yticklabels()}
