"""The rivals of the recovery benchmark: each answers, says why it cannot, and abstains where it is not sure."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import pytest

from suite import plugins
from suite.benchmark import conditions, recovery, sparse
from suite.benchmark.cells import Cell
from suite.model import Model


def test_a_rival_without_all_states_is_skipped_with_the_reason() -> None:
    """PySINDy differentiates every state, so a plant of which one is not measured is not asked of it."""
    case = plugins.cases()["paper-cubic"]
    trial = conditions.trial(case, "missing", 0.05, 0, plugins.effects())
    model: Model = replace(trial.model, outputs={"x2": trial.model.outputs["x2"]})
    part = replace(trial, model=model, record=replace(trial.record, y=trial.record.y[:, 1:].copy()))
    assert sparse.skip(part) == "it needs every state measured; x1 is not"


def test_a_missing_extra_is_said_with_the_mend(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PySINDy the row says how to get it."""
    monkeypatch.setattr(sparse, "find_spec", lambda name: None)
    row = recovery.run(Cell("paper-cubic", 0.05, "pysindy", "missing", 0))
    assert row["status"] == "skipped"
    assert "unmodelled[peers]" in row["reason"]


@pytest.mark.parametrize("method", list(recovery.RIVALS))
def test_every_rival_answers(method: str) -> None:
    """Each rival ranks the candidates of the paper's plant and is judged against the truth."""
    if "pysindy" in method and importlib.util.find_spec("pysindy") is None:
        pytest.skip("PySINDy is not installed; pip install 'unmodelled[peers]'")
    row = recovery.run(Cell("paper-cubic", 0.01, method, "missing", 0))
    assert row["status"] == "ok", row["reason"]
    assert 1 <= row["rank"] <= row["candidates"]
    assert isinstance(row["exact"], bool)


@pytest.mark.parametrize("method", ["correlation", "smoothed-regression"])
@pytest.mark.parametrize("case", ["duffing-wsindy", "van-der-pol-wsindy"])
def test_a_large_effect_in_a_measured_state_is_named(method: str, case: str) -> None:
    """Where every state is measured and the effect is most of the rate, a rival from the literature finds it."""
    row = recovery.run(Cell(case, 0.01, method, "missing", 0))
    assert (row["rank"], row["exact"]) == (1, True)


def test_the_correlation_test_abstains_where_chance_would_do() -> None:
    """Its answer is empty on complete models: a correlation counts after correction for the number of candidates."""
    for seed in range(4):
        row = recovery.run(Cell("null-oscillator", 0.05, "correlation", "null-right", seed))
        assert (row["status"], row["named"]) == ("ok", "")
