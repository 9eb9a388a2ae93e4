"""Fits side by side give what fits one after the other give."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from suite import plugins
from suite.discovery import abreast
from suite.discovery.verdict import diagnose


def test_results_come_in_the_order_of_the_items(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is done first: a later item waits for an earlier one here only if both run at once."""
    monkeypatch.setenv("UNMODELLED_THREADS", "2")
    second = threading.Event()

    def work(item: int) -> int:
        if item == 0:
            assert second.wait(20.0)
        second.set()
        return 10 * item

    assert abreast.each(work, range(5)) == [0, 10, 20, 30, 40]


def test_an_error_is_raised_and_what_has_not_begun_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first item's error ends it; of a hundred others only those at hand were tried."""
    monkeypatch.setenv("UNMODELLED_THREADS", "2")
    tried: list[int] = []

    def work(item: int) -> None:
        tried.append(item)
        if item == 0:
            raise ValueError("no")
        threading.Event().wait(0.05)

    with pytest.raises(ValueError, match="no"):
        abreast.each(work, range(100))
    assert len(tried) < 50


def test_a_thread_minds_overflows_as_its_caller_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """numpy's error state goes along: what is silent outside is silent inside."""
    monkeypatch.setenv("UNMODELLED_THREADS", "2")
    with np.errstate(over="ignore"):
        assert abreast.each(lambda x: float(np.exp(np.float64(x))), [1000.0, 2000.0]) == [np.inf, np.inf]
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        abreast.each(lambda x: float(np.exp(np.float64(x))), [1000.0, 2000.0])


def test_a_verdict_does_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last digit, for one effect and for a pair."""
    for name, noise in (("duffing", 0.05), ("boat-drag-and-wind", 0.05)):
        case = plugins.cases()[name]
        record, _ = case.simulate(noise, 3)
        said = []
        for count in ("1", "2", "3"):
            monkeypatch.setenv("UNMODELLED_THREADS", count)
            found = diagnose(case.deficient, record, plugins.effects()).to_json()
            said.append({key: value for key, value in found.items() if key != "seconds"})
        assert said[0] == said[1] == said[2]


def test_as_many_threads_as_the_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """The variable where it is a number, else the cores at hand."""
    monkeypatch.setenv("UNMODELLED_THREADS", "7")
    assert abreast.threads() == 7
    for odd in ("", "many", "0", "-2"):
        monkeypatch.setenv("UNMODELLED_THREADS", odd)
        assert abreast.threads() >= 1
