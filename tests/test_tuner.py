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
    assert found["evaluations"] == 0
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


def test_the_tuner_steps_both_ways_and_halves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every point is as good, it steps up and down by as much from where the search ended, then half as far."""
    monkeypatch.setattr(tuning, "_score", lambda *_: 1.0)
    found = tuning.tune("paper-cubic", 0.05, "ekf", None)
    assert (found["values"], found["score"], found["default_score"]) == ({}, 1.0, 1.0)
    (name,) = {name for point in found["points"] for name in point["values"]}
    tried = np.log([point["values"][name] for point in found["points"][1:]])
    search, steps = tried[: tuning.SEARCH], tried[tuning.SEARCH :] - tried[0]
    assert np.diff(search) == pytest.approx(np.full(tuning.SEARCH - 1, search[1] - search[0]))
    reach = 0.5 * (search[1] - search[0])
    low, high = np.log(plugins.estimators()["ekf"].tuning[name][:2])
    for k, step in enumerate(steps.tolist()):
        wanted = (reach if k % 2 == 0 else -reach) * 0.5 ** (k // 2)
        assert step == pytest.approx(np.clip(tried[0] + wanted, low, high) - tried[0], abs=1e-9)


def test_the_tuner_goes_to_the_better_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """With one smooth valley it ends nearer to its bottom than the search alone, and better than the default."""
    name = next(iter(plugins.estimators()["ekf"].tuning))
    bottom = 0.37

    def valley(case: object, estimator: object, records: object, values: dict[str, float]) -> float:
        return (np.log10(values[name]) - bottom) ** 2 if values else 9.0

    monkeypatch.setattr(tuning, "_score", valley)
    found = tuning.tune("paper-cubic", 0.05, "ekf", None)
    searched = [np.log10(point["values"][name]) for point in found["points"][1 : tuning.SEARCH + 1]]
    assert abs(np.log10(found["values"][name]) - bottom) < 0.3 * min(abs(value - bottom) for value in searched)
