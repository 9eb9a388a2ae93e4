"""The figures that rank methods, and the sentences beside them, say what the ranks say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from suite.benchmark import findings
from suite.benchmark.comparison import compare
from suite.benchmark.ranking import cliques, critical_difference
from suite.benchmark.statistics import interval
from suite.report import bench_ranking

Rows = Callable[..., list[dict[str, Any]]]

APART = {"generalized-ie": 1.0, "conventional-ie": 2.0, "sra": 4.0, "ekf": 3.0, "ukf": 3.0}
ALIKE = {"generalized-ie": 1.0, "conventional-ie": 1.0, "sra": 1.0, "ekf": 1.0}


@pytest.mark.parametrize(("errors", "said"), [(APART, "differ by more than chance"), (ALIKE, "could be chance")])
def test_the_sentence_on_ranks_is_friedmans(errors: dict[str, float], said: str, bench_rows: Rows) -> None:
    """Clear orders differ by more than chance, equal methods do not, and the page says which."""
    (sentence,) = (text for text in findings.verdict(compare(bench_rows(errors))) if "(Friedman, 8 cases" in text)
    assert f"The ranks of these methods {said} (Friedman" in sentence


@pytest.mark.parametrize("errors", [APART, ALIKE])
def test_the_diagram_joins_what_does_not_differ(errors: dict[str, float], bench_rows: Rows) -> None:
    """Every method is named with its mean rank, the better half at the left; a bar a clique, of the right ends."""
    c = compare(bench_rows(errors))
    figure = bench_ranking.critical_differences(c, "default")
    assert figure is not None
    (axes,) = figure.axes
    methods = c.methods("default")
    means = c.ranks(methods).mean(axis=1).tolist()
    texts = [text.get_text() for text in axes.texts]
    for i, (method, mean) in enumerate(zip(methods, means, strict=True)):
        left = i < -(-len(methods) // 2)
        assert (f"{method.estimator}  {mean:.1f}" if left else f"{mean:.1f}  {method.estimator}") in texts
    width = critical_difference(len(methods), len(c.cases))
    assert f"critical difference {width:.1f}" in texts
    bars = [sorted(line.get_xdata()) for line in axes.lines if line.get_linewidth() == 3.5]
    wanted = [(means[first], means[last]) for first, last in cliques(means, width)]
    assert np.array(bars) + np.array([0.06, -0.06]) == pytest.approx(np.array(wanted).reshape(-1, 2))


def test_no_diagram_of_one_method_or_one_case(bench_rows: Rows) -> None:
    """There is nothing to rank; no figure is better than an empty one."""
    assert bench_ranking.critical_differences(compare(bench_rows({"ekf": 1.0})), "default") is None
    assert bench_ranking.critical_differences(compare(bench_rows(ALIKE, cases=1)), "default") is None


def test_the_profile_and_the_front_show_who_is_best(bench_rows: Rows) -> None:
    """Highest at one is who is the best most often; on the front is whom none beats in both cost and error."""
    rows = bench_rows(APART)
    for row in rows:
        row["step_us"] = {"ekf": 1.0, "generalized-ie": 5.0}.get(str(row["estimator"]), 9.0)
    c = compare(rows)
    curves = {
        line.get_label(): np.asarray(line.get_ydata()) for line in bench_ranking.performance_profile(c).axes[0].lines
    }
    assert curves["generalized-ie"][0] == 1.0
    assert curves["ekf"][0] == 0.0
    assert all(curve[-1] == 1.0 and np.all(np.diff(curve) >= 0) for curve in curves.values())
    figure = bench_ranking.pareto(c)
    assert figure is not None
    assert sorted(text.get_text() for text in figure.axes[0].texts) == ["ekf", "generalized-ie"]


def test_more_curves_than_colours_are_grey_and_counted(bench_rows: Rows) -> None:
    """The best keep their names; the others are drawn, and the legend says how many they are."""
    c = compare(bench_rows({f"method{k}": 1.0 + k for k in range(bench_ranking.NAMED + 3)}))
    labels = [line.get_label() for line in bench_ranking.performance_profile(c).axes[0].lines]
    assert "3 others" in labels
    assert [f"method{k}" in labels for k in (0, bench_ranking.NAMED - 1, bench_ranking.NAMED)] == [True, True, False]


def test_below_six_cases_a_ratio_has_its_range_and_from_six_an_interval(bench_rows: Rows) -> None:
    """Five: the smallest and the largest ratio; six: the interval of resampled medians; the sentence says which."""
    for cases, word in ((5, "range"), (6, "95 % interval")):
        rows = bench_rows({"generalized-ie": 1.0, "ekf": 3.0}, cases=cases, seeds=3)
        c = compare(rows)
        ours, other = (next(m for m in c.rows if m.estimator == name) for name in ("generalized-ie", "ekf"))
        ratios = c.case_ratios(ours, other)
        assert len(ratios) == cases
        found = c.over_cases(ours, other)
        wanted = interval(ratios) if cases == 6 else (np.median(ratios), ratios.min(), ratios.max())
        assert found == pytest.approx(wanted)
        assert any(word in sentence for sentence in findings.verdict(c))


@pytest.mark.parametrize(("size", "worse"), [(0.5, False), (1.5, True)])
def test_an_estimate_of_d_that_is_no_better_than_zero_is_called_so(bench_rows: Rows, size: float, worse: bool) -> None:
    """The best median error of d in units of d: from one on it says that zero would do as well."""
    said = findings.verdict(compare(bench_rows({"generalized-ie": size, "sra": 2.0 * size, "ekf": 3.0})))
    (sentence,) = (text for text in said if text.startswith("The model error d itself"))
    assert f"{size:.2f} of the size of d" in sentence
    assert ("no estimate is better than zero" in sentence) == worse
