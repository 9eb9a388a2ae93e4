"""The cost of a step against size and length: what is timed, what is left out and why, and the command."""

from __future__ import annotations

from pathlib import Path

import pytest

from suite.__main__ import main
from suite.benchmark import cost


def test_the_plant_has_the_size_that_was_asked_for() -> None:
    """States and samples as asked, at most five outputs, and the prior that estimators start from."""
    for states, samples in ((2, 100), (10, 200), (20, 50)):
        model, record = cost.plant(states, samples)
        assert len(model.states) == states
        assert len(record) == samples
        assert len(model.outputs) == min(states // 2, 5)
        assert record.prior is not None


def test_a_series_ends_where_a_size_takes_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """With no budget the first size is timed and the others say which one was too slow."""
    monkeypatch.setattr(cost, "BUDGET", 0.0)
    monkeypatch.setattr(cost, "STATES", (2, 4, 10))
    rows = cost.series("generalized-ie-discrete", "states")
    assert [row["status"] for row in rows] == ["ok", "left out", "left out"]
    assert rows[0]["step_us"] == pytest.approx(1e6 * rows[0]["seconds"] / cost.SAMPLES)
    assert "2 states and 200 samples took" in rows[2]["reason"]


def test_a_method_that_refuses_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """The shapes of a refused model are kept with the method's own reason."""
    monkeypatch.setattr(cost, "LENGTHS", (50,))
    from suite import plugins

    name = "generalized-ie"
    monkeypatch.setattr(type(plugins.estimators()[name]), "skip", lambda self, model, record: "not today")
    (row,) = cost.series(name, "samples")
    assert (row["status"], row["reason"], row["states"], row["samples"]) == ("skipped", "not today", 2, 50)


def test_the_command_refuses_a_name_that_nothing_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and one sentence, before anything is measured."""
    assert main(["bench", "cost", "--estimators", "nobody", "-o", str(tmp_path)]) == 2
    assert "nobody" in capsys.readouterr().err


def test_figures_are_drawn_from_rows(tmp_path: Path) -> None:
    """Lines end where rows are not ok; the table keeps every row."""
    from suite.report import cost_figures

    rows = [
        {"estimator": name, "axis": axis, "states": 2 if axis == "samples" else size, "samples": size,
         "status": status, "reason": "", "seconds": 0.1, "step_us": 10.0 * size}
        for name in ("ekf", "generalized-ie")
        for axis in ("states", "samples")
        for size, status in ((2, "ok"), (4, "ok"), (10, "left out"))
    ]  # fmt: skip
    paths = cost_figures.write(rows, tmp_path)
    assert {path.name for path in paths} >= {"cost.csv", "cost-against-states.svg", "cost-against-length.png"}
    assert len((tmp_path / "cost.csv").read_text().splitlines()) == 1 + len(rows)
    text = (tmp_path / "cost-against-states.svg").read_text()
    assert "generalized-ie" in text
