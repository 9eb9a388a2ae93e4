"""What a long run says of itself: seldom, and at its end."""

from __future__ import annotations

import pytest

from suite.benchmark import progress
from suite.benchmark.progress import Progress


def test_a_log_gets_a_line_every_ten_seconds_and_the_last(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 12 steps of three seconds the fourth, the eighth and the last are told."""
    clock = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    with Progress("cells", 12) as told:
        for k in range(12):
            clock[0] += 3.0
            told.step(f"number {k}")
    assert capsys.readouterr().err.splitlines() == [
        "cells: 4 of 12, 12 s",
        "cells: 8 of 12, 24 s",
        "cells: 12 of 12, 36 s",
    ]


def test_a_run_of_nothing_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """No step, no line."""
    with Progress("cells", 0):
        pass
    assert capsys.readouterr().err == ""
