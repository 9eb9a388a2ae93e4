"""The tuner of the benchmark: every point is kept, and none is spent on what does not apply."""

from __future__ import annotations

import numpy as np
import pytest

from suite import plugins
from suite.benchmark import tuning
from suite.report import bench_sensitivity


def test_the_tuner_spends_nothing_on_what_does_not_apply(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method that refuses the case is not called once; the reason is kept in place of points."""
    method = plugins.estimators()["ekf"]
    monkeypatch.setattr(type(method), "skip", lambda *_: "needs a second sensor")
    monkeypatch.setattr(type(method), "estimate", lambda *_, **__: pytest.fail("the method was called"))
    found = tuning.tune("paper-cubic", 0.05, "ekf", None)
    assert (found["values"], found["skipped"], found["points"]) == ({}, "needs a second sensor", [])
    assert bench_sensitivity.points([found]) == []


def test_the_tuner_keeps_every_point() -> None:
    """As many points as evaluations, the default first, the best among them, and the envelope touches the best."""
    found = tuning.tune("paper-cubic", 0.05, "conventional-ie-discrete", None)
    assert len(found["points"]) == found["evaluations"] == tuning.EVALUATIONS
    assert found["points"][0]["values"] == {}
    scores = [point["score"] for point in found["points"] if point["score"] is not None]
    assert min(scores) == pytest.approx(found["score"])
    lines = bench_sensitivity.points([found])
    assert all("q_scale" in line for line in lines)
    values = np.array([line["q_scale"] for line in lines])
    _, envelope = bench_sensitivity.envelope(values, np.array([line["score"] or np.inf for line in lines]), True)
    assert envelope.min() == pytest.approx(found["score"])
