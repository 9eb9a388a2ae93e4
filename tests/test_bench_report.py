"""The report of the benchmark says what the rows say, ranks as the textbooks do, and opens anywhere."""

from __future__ import annotations

import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import wilcoxon

from suite import plugins
from suite.benchmark import findings, metrics, ranking, statistics, tuning
from suite.benchmark.cells import Cell, experiment
from suite.benchmark.comparison import compare
from suite.benchmark.store import Store
from suite.errors import InputError
from suite.estimator import Estimate
from suite.metric import Judged, Metric
from suite.report import bench_page
from suite.report.bench_matrix import color, matrix

Rows = Callable[..., list[dict[str, Any]]]


def test_the_critical_difference_is_demsars() -> None:
    """Demsar's (2006) example in section 3.2.4: four classifiers, 14 data sets, critical difference 1.25."""
    assert ranking.critical_difference(4, 14) == pytest.approx(1.25, abs=0.005)
    # Table 5(a) of the paper: q for 10 classifiers is 3.164.
    assert ranking.critical_difference(10, 1) == pytest.approx(3.164 * np.sqrt(110 / 6), rel=1e-3)


def test_cliques_join_what_does_not_differ() -> None:
    """Bars cover all pairs closer than the difference, none farther, and no bar lies within another."""
    means = [1.0, 1.5, 2.6, 4.0, 4.2]
    assert ranking.cliques(means, 1.2) == [(0, 1), (1, 2), (3, 4)]
    rng = np.random.default_rng(4)
    for _ in range(200):
        means = np.sort(rng.uniform(1.0, 9.0, 8)).tolist()
        near = [(i, j) for i in range(8) for j in range(i + 1, 8) if means[j] - means[i] <= 1.7]
        largest = [(i, j) for i, j in near if not any(a <= i and j <= b and (a, b) != (i, j) for a, b in near)]
        assert ranking.cliques(means, 1.7) == largest


def test_a_profile_counts_failures_as_never_solved() -> None:
    """The profile at 1 is the share of wins; a method that fails on a block never reaches it."""
    scores = np.array([[1.0, 4.0, 1.0], [2.0, 1.0, np.inf]])
    found = ranking.profile(scores, np.array([1.0, 2.0, 1e9]))
    assert found[0] == pytest.approx([2 / 3, 2 / 3, 1.0])
    assert found[1] == pytest.approx([1 / 3, 2 / 3, 2 / 3])


def test_the_front_holds_no_dominated_point() -> None:
    """Every point off the front is beaten in cost and error by one on it, and none on it is."""
    rng = np.random.default_rng(1)
    points = {i: (float(a), float(b)) for i, (a, b) in enumerate(rng.random((40, 2)))}
    line = ranking.front(points)
    for i, (cost, error) in points.items():
        beaten = any(points[j][0] <= cost and points[j][1] <= error for j in line if j != i)
        assert beaten == (i not in line)


def test_a_failure_counts_against_who_failed() -> None:
    """In tests and ratios a failed seed is a loss, as it would be with a huge error."""
    good = {seed: 1.0 + 0.01 * seed for seed in range(8)}
    half = {seed: np.inf if seed % 2 else 0.9 for seed in range(8)}
    huge = {seed: 1e6 + seed if seed % 2 else 0.9 for seed in range(8)}
    assert statistics.signed_rank(half, good) == pytest.approx(statistics.signed_rank(huge, good), abs=0.05)
    assert np.isinf(statistics.ratios(half, good)[1::2]).all()
    always = dict.fromkeys(range(8), np.inf)
    assert statistics.signed_rank(always, good) == pytest.approx(wilcoxon(np.ones(8) + np.arange(8)).pvalue)


def test_an_interval_is_that_of_resampled_medians() -> None:
    """The interval agrees with plain resampling and covers the median of a known law in about 95 of 100 samples."""
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(300):
        _, low, high = statistics.interval(rng.standard_normal(21))
        hits += low <= 0.0 <= high
    assert 0.90 < hits / 300 <= 1.0
    values = rng.random(15)
    plain = np.median(values[rng.integers(0, 15, (20_000, 15))], axis=1)
    assert statistics.interval(values)[1] == pytest.approx(np.quantile(plain, 0.025), abs=0.08)


def test_the_best_not_beaten_are_those_that_chance_cannot_tell(bench_rows: Rows) -> None:
    """A twin of the best is not beaten, one three times worse is; few seeds cannot show it."""
    c = compare(bench_rows({"a": 1.0, "twin": 1.001, "worse": 3.0, "ekf": np.inf}))
    scores = {m: c.by_seed(m, c.conditions[0]) for m in c.methods()}
    best, equals, able = ranking.not_beaten(scores)
    assert best is not None
    assert {m.estimator for m in equals} == {"a", "twin"}
    assert able
    few = {m: dict(list(table.items())[:3]) for m, table in scores.items()}
    assert not ranking.not_beaten(few)[2]


def test_what_ran_on_few_seeds_wins_only_on_those() -> None:
    """Two seeds make no best where others have eight, and are equal to it only if they are as good on them."""
    full = {seed: 1.0 + 0.01 * seed for seed in range(8)}
    best, equals, able = ranking.not_beaten({"full": full, "lucky": {0: 0.9, 1: 0.9}, "slow": {0: 1.2, 1: 1.2}})
    assert (best, equals, able) == ("full", {"full", "lucky"}, True)


def test_a_difference_that_nobody_would_notice_is_no_victory(bench_rows: Rows) -> None:
    """Half a per cent on every case, however sure."""
    rows = bench_rows({"generalized-ie": 1.0})
    rows += [{**row, "estimator": "ekf", "state_nrmse": 0.995 * row["state_nrmse"]} for row in rows]
    said = findings.verdict(compare(rows))
    assert said[0].startswith("Neither side wins: the best Kalman filter and the best model-error estimator are level")


def test_a_method_without_any_error_is_no_trouble(bench_rows: Rows) -> None:
    """A plant that stands still is estimated exactly: a ratio of zero."""
    said = findings.verdict(compare(bench_rows({"generalized-ie": 0.0, "ekf": 1.0})))
    assert said[0].startswith("A model-error estimator beats the best Kalman filter: generalized-ie has 0.00 times")


def test_the_champion_has_enough_seeds(bench_rows: Rows) -> None:
    """Who would rank before it on fewer is named beside it."""
    rows = bench_rows({"generalized-ie": 0.5, "ekf": 1.0, "conventional-ie": 0.4})
    said = findings.verdict(compare(row for row in rows if row["estimator"] != "conventional-ie" or row["seed"] < 2))
    assert any("generalized-ie ranks best" in s and "conventional-ie (2) would rank before it" in s for s in said)
    assert "1 of them, slow ones, have fewer than 6 seeds" in said[2]


def test_reference_rows_are_never_ranked(bench_rows: Rows) -> None:
    """An oracle better than all wins nothing, and stands apart in the matrix."""
    rows = bench_rows({"generalized-ie": 0.5, "ekf": 1.0})
    for name, error in (("oracle", 0.01), ("bound", 0.001)):
        rows += [{**row, "kind": "reference"} for row in bench_rows({name: error})]
    c = compare(rows)
    assert {m.estimator for m in c.methods()} == {"generalized-ie", "ekf"}
    assert {m.estimator for m in c.references} == {"oracle", "bound"}
    found = matrix(c, "default")
    assert found is not None
    assert [m.estimator for m in found.references] == ["bound", "oracle"]
    assert not any("oracle" in sentence or "bound" in sentence for sentence in findings.verdict(c))


def test_the_verdict_follows_the_numbers(bench_rows: Rows) -> None:
    """Who has the smaller errors is said to win, a tie is said to be one, and who fails is named with its count."""
    said = findings.verdict(compare(bench_rows({"generalized-ie": 0.5, "ekf": 1.0, "sra": np.inf})))
    assert said[0].startswith("A model-error estimator beats the best Kalman filter: generalized-ie has 0.")
    assert any("Who breaks: sra 80 of 80" in sentence for sentence in said)
    said = findings.verdict(compare(bench_rows({"generalized-ie": 1.0, "ekf": 0.3})))
    assert said[0].startswith("A Kalman filter beats the best model-error estimator: ekf has 0.")
    tie = findings.verdict(compare(bench_rows({"generalized-ie": 1.0, "ekf": 1.0}, cases=7)))
    assert tie[0].startswith("Neither side wins")


def test_colours_are_symmetric_and_readable() -> None:
    """Equal factors up and down are equally far from white, and text keeps a contrast of 4.5 on every colour."""

    def light(text: str) -> float:
        parts = [int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))

    for ratio in np.geomspace(0.05, 20.0, 81):
        background, dark = color(float(ratio))
        pair = sorted((light(background), 1.0 if dark else 0.0))
        assert (pair[1] + 0.05) / (pair[0] + 0.05) > 4.5


class _Outside(HTMLParser):
    """What a page loads or runs."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.titles = 0
        self.figures = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.titles += tag == "desc"
        self.figures += tag == "figure"
        self.found += [f"{tag} {k}={v}" for k, v in attrs if k in ("src", "href") and not str(v).startswith("#")]
        self.found += [tag] if tag in ("script", "link", "iframe") else []


def test_the_page_comes_from_the_store_alone(tmp_path: Path) -> None:
    """From real cells and a real tuning in a store: one page without scripts or outside references, under 2 MB, the
    same bytes each time, every figure described, failures verbatim and escaped.
    """
    from suite.benchmark import cells

    path = tmp_path / "store.sqlite"
    with Store(path) as store:
        for name in ("generalized-ie", "ekf", "random-walk-smoother"):
            for seed in range(2):
                cell = Cell("paper-cubic", 0.05, name, "default", seed)
                store.put(cell, "key", cells.run(cell, {}, None))
        store.put(Cell("paper-cubic", 0.05, "sra", "default", 0), "key", {"status": "error", "reason": "1 < 2 & so on"})
        store.put_tuning("key", tuning.tune("paper-cubic", 0.05, "conventional-ie-discrete", None))
        rows, tunings = store.rows(), tuning.stored(store)
    made = bench_page.write(rows, tunings, tmp_path / "a", "store.sqlite")
    bench_page.write(rows, tunings, tmp_path / "b", "store.sqlite")
    page = (tmp_path / "a" / "report.html").read_text(encoding="utf-8")
    assert page == (tmp_path / "b" / "report.html").read_text(encoding="utf-8")
    assert len(page.encode()) < 2e6
    seen = _Outside()
    seen.feed(page)
    assert seen.found == []
    assert seen.titles == seen.figures >= 4
    assert "1 &lt; 2 &amp; so on" in page
    assert made["verdict"][0].split(":")[0] in page
    order = ["State error over", "Who wins where", "Performance profile", "Accuracy against", "Consistency",
             "Tuning sensitivity", "Case by case", "Definitions", "Failures, verbatim", "How to reproduce"]  # fmt: skip
    places = [page.index(f">{title}") for title in order]
    assert places == sorted(places)
    assert "unmodelled bench report" in page
    assert rows[0]["plugin_hash" if "plugin_hash" in rows[0] else "status"] in page
    files = {Path(file).name for file in made["files"]}
    assert {"rows.parquet", "summary.csv", "matrix.csv", "failures.csv", "tuning-points.csv"} <= files
    assert {"case-paper-cubic.svg", "sensitivity.svg", "consistency.svg"} <= files
    assert not re.search(r"\$\\math", page)


def test_an_empty_store_is_one_sentence(tmp_path: Path) -> None:
    """Without rows the verb says how to make some."""
    with pytest.raises(InputError, match="holds no estimate to report"):
        bench_page.write([], [], tmp_path, "none.sqlite")


def _double(judged: Judged) -> float:
    return 2.0 * float(judged.estimate.x.shape[1])


def _fails(judged: Judged) -> float:
    raise ZeroDivisionError("on purpose")


def test_a_metric_is_one_object(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's metric is a number of the row; one that raises or takes a field's name leaves the row and says so."""
    mine = {m.name: m for m in (Metric("mine", "", _double), Metric("bad", "", _fails), Metric("seed", "", _double))}
    monkeypatch.setattr(plugins, "metrics", lambda: mine)
    case = plugins.cases()["paper-cubic"]
    record, truth = experiment(case, 0.05, 0, None)
    assert truth is not None
    row = metrics.judge(case, record, truth, Estimate(x=truth.x), "filter")
    assert row["mine"] == 4.0
    assert row["state_nrmse"] == 0.0
    assert row["metric_errors"]["bad"] == "ZeroDivisionError: on purpose"
    assert "already" in row["metric_errors"]["seed"]
    assert "seed" not in row


def test_coverage_and_whiteness_are_right_for_an_exact_filter() -> None:
    """On a linear plant driven as it assumes the Kalman filter's band covers 95 %, its innovations are white; with a
    process noise far too small they correlate and the band misses.
    """
    from dataclasses import replace

    from suite.case import Case, Experiment
    from suite.model import Initial, Model, Output
    from suite.prior import default_prior

    model = Model("still", {"x": "0*x"}, outputs={"x": Output("x", "x")}, initial={"x": Initial(0.0, estimate=True)})
    case = Case("still", "", model, truth=model, experiment=Experiment(100.0, 0.05, (1.0,)))
    record, truth = case.simulate(0.0, 0)
    rng = np.random.default_rng(3)
    x = 1.0 + np.cumsum(0.1 * np.sqrt(0.05) * rng.standard_normal(len(record)))[:, None]
    record = replace(record, y=x + 0.05 * rng.standard_normal(x.shape))
    found = {}
    for Q in (0.01, 1e-5):
        prior = replace(default_prior(model, record, np.array([0.05])), Q=np.array([Q]))
        estimate = plugins.estimators()["ekf"].estimate(model, record.with_prior(prior))
        found[Q] = metrics.judge(case, record.with_prior(prior), replace(truth, x=x), estimate, "filter")
    assert found[0.01]["coverage"] == pytest.approx(0.95, abs=0.02)
    assert abs(found[0.01]["innovation_r1"]) < 0.07
    assert found[1e-5]["coverage"] < 0.5
    assert found[1e-5]["innovation_r1"] > 0.3
