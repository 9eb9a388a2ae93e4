"""Every effect has a picture: what it adds along a typical motion is finite, seen, and written whole."""

from __future__ import annotations

import argparse
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from suite import listing, plugins
from suite.effect import Effect
from suite.report import effect_page
from suite.report.effect_trace import trace

EFFECTS = plugins.effects()
STEADY = {"constant_force", "constant_term", "sensor_bias", "wrong_value"}  # the same all the time


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_a_trace(name: str) -> None:
    """Finite throughout, and changing along the motion unless the effect is a constant."""
    found = trace(EFFECTS[name])
    assert np.isfinite(found.d).all()
    assert np.isfinite(found.variable).all()
    assert np.abs(found.d).max() > 0
    assert (np.ptp(found.d) > 0) == (name not in STEADY)
    assert (found.before is None) == (found.place == "rate")
    if found.before is not None and found.after is not None:
        assert np.isfinite(found.after).all()
        assert np.ptp(found.after - found.before) + abs(found.d).max() > 0


def test_a_term_of_one_variable_is_what_its_text_says() -> None:
    """The cubic spring's trace is -p^3, and dry friction's has the width that its start gives."""
    cubic = trace(EFFECTS["cubic_stiffness"])
    assert cubic.label == "p"
    assert not cubic.path
    np.testing.assert_allclose(cubic.d, -(cubic.variable**3), atol=1e-12)
    dry = trace(EFFECTS["coulomb_friction"])
    assert dry.scales["w"] == pytest.approx(0.02 * np.ptp(dry.variable))


@pytest.mark.parametrize("name", ["bouc_wen_hysteresis", "backlash", "sensor_lag"])
def test_an_effect_with_a_memory_draws_loops(name: str) -> None:
    """At one place of its variable it takes values that are far apart: where it came from tells."""
    found = trace(EFFECTS[name])
    x = found.variable if found.before is None else found.before
    near = np.abs(x - np.median(x)) < 0.02 * np.ptp(x)
    assert found.path
    assert np.ptp(found.d[near]) > 0.3 * np.ptp(found.d)


def test_an_added_state_follows_its_equation() -> None:
    """The sensor's lag: z' = (y - z)/w, by difference quotients."""
    found = trace(EFFECTS["sensor_lag"])
    assert found.before is not None
    assert found.after is not None
    slope = np.gradient(found.after, found.t)
    wanted = (found.before - found.after) / found.scales["w"]
    assert np.abs(slope - wanted)[4:-4].max() < 0.02 * np.abs(wanted).max()


def test_the_page_and_its_pictures_are_written_whole(tmp_path: Path) -> None:
    """Each picture is well-formed SVG with its title, each effect stands on the page; nothing else is left."""
    chosen = {name: EFFECTS[name] for name in ("cubic_stiffness", "sensor_bias", "harmonic_forcing")}
    chosen["own"] = Effect("own", "-a*x*q", {"x": "state"}, "A term with an unknown name.", "")
    paths = effect_page.write(chosen, tmp_path)
    page = (tmp_path / "effects.md").read_text(encoding="utf-8")
    for name, effect in chosen.items():
        assert f"### {name}" in page
        assert f"`{effect.term}`" in page
        assert effect.sentence in page
    assert "No picture: the term -a*x*q" in page
    for path in paths[:-1]:
        root = ElementTree.parse(path).getroot()
        assert root.tag.endswith("svg")
        assert root[0].text
        assert f"effects/{path.name}" in page
    assert sorted(p.name for p in tmp_path.rglob("*")) == sorted([*(p.name for p in paths), "effects"])


def test_list_names_every_effect(capsys: pytest.CaptureFixture[str]) -> None:
    """`unmodelled list` without a folder prints them."""
    assert listing.run(argparse.Namespace(effects=None, json=False)) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in EFFECTS)


def test_the_committed_page_holds_the_library() -> None:
    """docs/effects.md is made from the effects as they are."""
    docs = Path(__file__).resolve().parents[1] / "docs"
    page = (docs / "effects.md").read_text(encoding="utf-8")
    for name, effect in EFFECTS.items():
        assert f"### {name}" in page
        assert effect_page.said(effect) in page
        assert (docs / "effects" / f"{name}.svg").is_file()
