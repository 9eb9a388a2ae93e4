"""The benchmark's judge is right where the answer is known, and the sources' Table 1 comes out of it."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import wilcoxon

from suite import along, plugins
from suite.benchmark import claims, hashes, metrics, plan, sources, statistics, table
from suite.benchmark.cells import Cell
from suite.errors import InputError
from suite.estimator import Estimate
from suite.model import Model, Output, Parameter
from suite.prior import default_prior
from suite.record import Record


def test_table_1_is_reproduced_within_one_percent() -> None:
    """All four printed numbers of Table 1 come from the one declared setting."""
    ledger = {row["id"]: row for row in claims.ledger()}
    for name in ("generalized-a3", "generalized-J", "conventional-a3", "conventional-J"):
        row = ledger[f"table1-{name}"]
        assert row["ours"] == pytest.approx(row["published"], rel=0.01)
        assert row["status"] == "reproduced"
        assert "a reconstruction, one of many" in row["setting"]
    assert {tuple(row) for row in ledger.values()} == {
        ("id", "source", "setting", "published", "ours", "tolerance", "status")
    }


def test_the_judge_finds_the_truth_perfect() -> None:
    """The true states and model error score zero error, the true coefficients and the right shape."""
    for name in ("paper-cubic", "paper-terms"):
        case = plugins.cases()[name]
        record, truth = case.simulate(0.0, 0)
        record = record.with_prior(default_prior(case.deficient, record, truth.noise))
        row = metrics.judge(case, record, truth, Estimate(x=truth.x, d=truth.d), "filter")
        assert row["state_nrmse"] == 0.0
        assert row["d_nrmse"] == 0.0
        assert row["parameter_worst"] < 1e-9
        assert row.get("named", 1) == 1


def test_an_angle_just_short_of_a_turn_is_a_small_error() -> None:
    """The residual of an output that is an angle is counted around the circle."""
    model = Model("turn", {"a": "w"}, parameters={"w": Parameter(0.0)}, outputs={"a": Output("a", "a", angle=True)})
    record = Record(np.arange(3.0), np.zeros((3, 0)), np.array([[3.1], [-3.1], [np.nan]]))
    missed, _ = along.residuals(model, record, np.full((3, 1), 3.12))
    np.testing.assert_allclose(missed[:2, 0], [-0.02, 2 * np.pi - 6.22], rtol=1e-9)
    assert np.isnan(missed[2, 0])
    with pytest.raises(ValueError, match=r"expected states of the shape \(3, 1\), got \(2, 1\)"):
        along.outputs(model, record, np.zeros((2, 1)))


def test_statistics_of_many_lines_at_once_are_those_of_each() -> None:
    """Intervals are those of 2000 plain resamples, p-values those of scipy's test of each pair, with failures,
    which tie, and differences of zero among them.
    """
    rng = np.random.default_rng(1)
    for count in (1, 2, 7, 20):
        table = rng.lognormal(size=(5, count))
        table[rng.random(table.shape) < 0.2] = np.inf
        picks = np.random.default_rng(0).integers(0, count, (2000, count))
        for values, found in zip(table, statistics.intervals(table), strict=True):
            medians = np.sort(np.median(np.sort(values)[picks], axis=1))
            assert found.tolist() == [np.median(values), medians[round(0.025 * 1999)], medians[round(0.975 * 1999)]]
    pairs = []
    for count in (3, 6, 6, 12, 25):
        a, b = np.exp(rng.standard_normal((2, count)))
        pairs.append((dict(enumerate(a)), dict(enumerate(b))))
        a[0], a[1], a[2] = np.inf, np.inf, b[2]
        pairs.append((dict(enumerate(a)), dict(enumerate(b))))
    for (mine, base), p in zip(pairs, statistics.signed_ranks(pairs), strict=True):
        gaps = np.array([np.log(mine[s] / base[s]) for s in mine])
        gaps[np.isinf(gaps)] = 1e6
        assert p == pytest.approx(float(wilcoxon(gaps).pvalue) if len(mine) > 4 else 1.0, rel=1e-12)


def test_failures_rank_last_and_are_counted() -> None:
    """A failed seed makes the median worse, never the count smaller."""
    good = [{"case": "c", "noise": 0.0, "estimator": "a", "variant": "default", "seed": s, "status": "ok", "reason": "",
             "state_nrmse": 0.1} for s in range(3)]  # fmt: skip
    bad = [{**row, "estimator": "b", "status": "diverged", "reason": "left"} for row in good]
    lines = statistics.summarise([*bad, *good], ("state_nrmse",), reference="a")
    assert [line["estimator"] for line in lines] == ["a", "b"]
    assert (lines[1]["ok"], lines[1]["seeds"], lines[1]["reason"]) == (0, 3, "left")
    assert np.isinf(lines[1]["state_nrmse"])
    mean = statistics.ranks({"a": {0: 1.0, 1: 2.0}, "b": {0: 0.5}})
    assert mean == {"a": 1.5, "b": 1.5}


def test_holm_is_the_textbook_adjustment() -> None:
    """Holm's p-values: sorted, times the number left, never decreasing, at most 1."""
    assert statistics.holm([0.01, 0.04, 0.03, 0.5]) == pytest.approx([0.04, 0.09, 0.09, 0.5])


def test_a_table_goes_to_every_format(tmp_path: Path) -> None:
    """CSV, parquet and standard JSON hold the same rows; infinities become null in JSON."""
    import pandas as pd

    rows = [{"case": "c", "status": "ok", "J": float("inf"), "state_rmse": {"x1": 0.5}}]
    for ending in (".csv", ".parquet", ".json"):
        table.write(rows, tmp_path / f"t{ending}")
    assert pd.read_csv(tmp_path / "t.csv")["state_rmse.x1"].tolist() == [0.5]
    assert pd.read_parquet(tmp_path / "t.parquet")["state_rmse.x1"].tolist() == [0.5]
    assert json.loads((tmp_path / "t.json").read_text())[0]["J"] is None
    with pytest.raises(InputError, match="change the ending"):
        table.write(rows, tmp_path / "t.xlsx")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("cases = 3", "expected a list of names"),
        ("seeds = 0", "must be positive"),
        ("speed = 1", "is not an entry of a plan"),
        ('variants = ["best"]', "expected some of default, tuned"),
        ("cases = [", "not TOML"),
    ],
)
def test_a_bad_plan_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    """What is wrong with a plan is said with its file."""
    path = tmp_path / "p.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        plan.load(str(path))
    assert "\n" not in str(caught.value)


def test_shipped_plans_load() -> None:
    """Every plan of the package is sound and has cells."""
    for name in plan.shipped():
        assert plan.load(name).cells()


def test_keys_follow_what_they_depend_on() -> None:
    """A cell's key is stable, and differs by seed."""
    keys = hashes.Keys(None)
    cell = Cell("paper-cubic", 0.05, "generalized-ie", "tuned", 0)
    assert keys.cell(cell) == hashes.Keys(None).cell(cell)
    assert keys.cell(cell) != keys.cell(Cell("paper-cubic", 0.05, "generalized-ie", "tuned", 1))


def test_a_key_follows_the_modules_that_a_plug_in_builds_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A number that another distribution's plug-in imports from a module of its own package changes its hash, wherever
    the import stands; a comment or a docstring does not, nor does a module that it does not import.
    """
    package = tmp_path / "foreign_filters"
    package.mkdir()
    files = {
        "__init__.py": "",
        "gain.py": '"""A filter."""\nfrom .numbers_of_it import GAIN\n\n\nclass Gain:\n    """One."""\n\n'
        "    def estimate(self):\n        from foreign_filters import late\n        return GAIN * late.HALF\n",
        "numbers_of_it.py": "GAIN = 2.0\n",
        "late.py": "from suite.disturbance import SHARE\nHALF = 0.5 * SHARE\n",
        "apart.py": "OTHER = 1\n",
    }

    def digest(**changed: str) -> str:
        for name, text in {**files, **{f"{name}.py": text for name, text in changed.items()}}.items():
            (package / name).write_text(text, encoding="utf-8")
        for kept in (sources.text, sources.imported):
            kept.cache_clear()
        return hashes.plugin(module.Gain())

    for name, text in files.items():
        (package / name).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = importlib.import_module("foreign_filters.gain")
    before = digest()
    assert digest(numbers_of_it="GAIN = 3.0\n") != before
    assert digest(late="HALF = 0.5\n") != before
    assert (
        digest(numbers_of_it="# two\nGAIN = 2.0\n", gain=files["gain.py"].replace("One.", "A constant gain.")) == before
    )
    assert digest(apart="OTHER = 2\n") == before
    assert {name for name, _ in sources.closure("foreign_filters.gain")} >= {"suite.disturbance", "suite.model"}
    sources.text.cache_clear()
    sources.imported.cache_clear()


def test_no_module_that_an_estimator_loads_is_missing_from_its_key() -> None:
    """What the import statements say is at least what a fresh process loads for a filter with a disturbance."""
    script = "import sys, baselines.ekf\nprint(*[name for name in sys.modules if name.split('.')[0] in %r])"
    run = [sys.executable, "-c", script % (sources.OURS,)]
    loaded = set(subprocess.run(run, capture_output=True, text=True, check=True).stdout.split())
    found = {name for name, _ in sources.closure("baselines.ekf")}
    assert "suite.disturbance" in found
    assert loaded - found <= {"baselines", "estimators"}


def test_help_imports_nothing_heavy() -> None:
    """Building the command line of `bench` imports no numerics."""
    script = (
        "import argparse, sys\nfrom suite.bench_verbs import add_parser\n"
        "add_parser(argparse.ArgumentParser().add_subparsers())\n"
        "print([m for m in ('numpy', 'scipy', 'numba', 'sympy', 'pandas', 'matplotlib') if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_figures_come_from_stored_rows(tmp_path: Path) -> None:
    """Figures are drawn from rows alone, with failures among them, as SVG and PNG."""
    from suite.report import bench_figures

    rows = [
        {"case": "c", "noise": noise, "estimator": name, "variant": variant, "seed": seed, "reason": "",
         "status": "diverged" if name == "b" else "ok", "state_nrmse": 0.1 + seed, "d_nrmse": 0.3, "step_us": 10.0}
        for noise in (0.0, 0.05) for name in ("a", "b", "ekf") for variant in ("default", "tuned") for seed in range(3)
    ]  # fmt: skip
    paths = bench_figures.draw(rows, tmp_path)
    assert {path.suffix for path in paths} == {".svg", ".png"}
    assert all(path.stat().st_size > 1000 for path in paths)
