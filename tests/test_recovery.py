"""The recovery benchmark counts what it says it counts, and the method names what is missing and nothing else."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suite import plugins
from suite.__main__ import main
from suite.benchmark import conditions, hashes, plan, recovery, recovery_summary
from suite.benchmark.cells import Cell
from suite.benchmark.statistics import wilson
from suite.benchmark.store import Store
from suite.errors import InputError

TRUTH = "cubic_stiffness@x1"


def made_up(**changes: Any) -> dict[str, Any]:
    """A row of a verdict that is right in every way."""
    row = {
        "kind": "recovery", "case": "c", "noise": 0.01, "estimator": "unmodelled", "variant": "missing", "seed": 0,
        "status": "ok", "reason": "", "missing": TRUTH, "named": TRUTH, "verdict": "missing_effect", "weight": 0.95,
        "alarm": True, "first": True, "exact": True, "in_plausible": True, "first_merged": True, "exact_merged": True,
        "in_plausible_merged": True, "plausible": [TRUTH], "plausible_weights": [0.95], "delta2": 30.0,
        "delta2_merged": 30.0, "z": {"a": 0.5}, "residual": 1.0, "ljung_box_after": 0.5, "candidates": 10,
        "samples": 100, "seconds": 1.0, "cpu_seconds": 1.0,
    }  # fmt: skip
    return row | changes


def wrongly(name: str = "coulomb_friction@x1", **changes: Any) -> dict[str, Any]:
    """A row that names another effect."""
    keys = ("first", "exact", "in_plausible", "first_merged", "exact_merged", "in_plausible_merged")
    return made_up(named=name, z=None, **dict.fromkeys(keys, False), **changes)


def figure(rows: list[dict[str, Any]], name: str) -> dict[str, Any]:
    return next(target for target in recovery_summary.targets(rows) if target["id"] == name)


def test_a_failed_cell_is_a_wrong_answer_and_a_skipped_one_none() -> None:
    """Of eight right answers, one wrong, one error and one skipped, eight of ten count as first."""
    rows = [made_up(seed=seed) for seed in range(8)]
    rows += [wrongly(seed=8), {k: made_up(seed=9, status="time-out")[k] for k in
             ("kind", "case", "noise", "estimator", "variant", "seed", "status", "reason")}]  # fmt: skip
    rows += [made_up(seed=10, status="skipped")]
    found = figure(rows, "first, 1 %")
    assert (found["figure"], found["count"], found["reached"]) == (0.8, 10, False)
    assert found["note"] == "1 of them failed"


def test_only_what_can_be_told_apart_counts_where_delta2_is_16() -> None:
    """A wrong answer at delta^2 = 3 does not count against the first demand, one at 17 does."""
    rows = [made_up(), wrongly(delta2=3.0)]
    assert figure(rows, "first, delta2 >= 16")["figure"] == 1.0
    assert figure([*rows, wrongly(delta2=17.0)], "first, delta2 >= 16")["figure"] == 0.5


def test_a_look_alike_is_wrong_strictly_and_right_merged() -> None:
    """A verdict that names a look-alike of the truth is first only where look-alikes count as one."""
    alike = wrongly() | {"first_merged": True, "exact_merged": True, "in_plausible_merged": True}
    assert figure([alike], "first, 1 %")["figure"] == 0.0
    assert figure([alike], "first, 1 %, merged")["figure"] == 1.0
    assert figure([alike], "certain and wrong")["figure"] == 0.0


def test_false_certainty_is_counted_on_every_plain_condition() -> None:
    """A sure wrong name counts on missing, complete and outside records; an unsure one, or a spoiled record, not."""
    sure = [wrongly(variant=variant) for variant in ("missing", "null-right", "outside")]
    rest = [wrongly(weight=0.6), wrongly(variant="outliers"), made_up()]
    found = figure(sure + rest, "certain and wrong")
    assert (found["figure"], found["count"]) == (0.75, 4)
    by = {line["condition"]: line for line in recovery_summary.by_condition(sure + rest)}
    assert by["outliers"]["certain_wrong"] == 1.0


def test_coefficient_errors_are_judged_by_what_was_stated() -> None:
    """Coefficients off by twice what was stated give a figure of two and too little cover."""
    z = 2.0 * np.random.default_rng(0).standard_normal(400)
    rows = [made_up(seed=seed, z={"a": float(value)}) for seed, value in enumerate(z)]
    assert figure(rows, "z")["figure"] == pytest.approx(2.0, rel=0.1)
    assert figure(rows, "z")["low"] < 2.0 < figure(rows, "z")["high"]
    assert not figure(rows, "cover")["reached"]
    honest = [made_up(seed=seed, z={"a": float(value / 2.0)}) for seed, value in enumerate(z)]
    assert figure(honest, "z")["reached"]
    assert figure(honest, "cover")["reached"]


def test_pairs_and_the_unexplained_are_counted_apart() -> None:
    """Two missing effects count in their own demand; 'none of these' only where it was said."""
    pair = made_up(missing="a@x+b@x", named="a@x+b@x")
    assert figure([pair], "pairs")["count"] == 1
    assert figure([pair], "first, 1 %")["count"] == 0
    said = made_up(variant="outside", verdict="unexplained", named="")
    assert figure([said, wrongly(variant="outside")], "none of these")["figure"] == 0.5


def test_who_looked_for_pairs_is_known_of_rows_that_do_not_say_so() -> None:
    """Where two effects were taken out, or the true one is in no library; a row that says so is believed."""
    assert recovery_summary.sought(made_up(missing="a@x+b@x"))
    assert recovery_summary.sought(made_up(variant="outside"))
    assert not recovery_summary.sought(made_up())
    assert recovery_summary.sought(made_up(depth=2))
    assert not recovery_summary.sought(made_up(missing="a@x+b@x", depth=1))


def test_methods_are_compared_on_the_same_records() -> None:
    """Beside a rival stands our share on the records that it was judged on, not on all."""
    ours = [made_up(seed=0), wrongly(seed=1)]
    rival = made_up(estimator="pysindy", seed=1, exact=False)
    line = next(line for line in recovery_summary.by_method([*ours, rival]) if line["method"] == "pysindy")
    assert (line["records"], line["first"], line["exact"], line["ours_exact"]) == (1, 1.0, 0.0, 0.0)
    broken = made_up(estimator="pysindy", seed=0, status="error", reason="singular", first=False, exact=False)
    line = next(line for line in recovery_summary.by_method([*ours, rival, broken]) if line["method"] == "pysindy")
    assert (line["records"], line["failed"], line["first"], line["reason"]) == (2, 1, 0.5, "singular")


@pytest.mark.parametrize(("share", "count"), [(0.02, 40), (0.5, 20), (0.95, 60)])
def test_wilson_intervals_cover(share: float, count: int) -> None:
    """The 95 % interval holds the true share in 93 to 99 of 100 experiments, and at 0 and 1 it is no point."""
    hits = np.random.default_rng(1).binomial(count, share, 4000)
    inside = [low <= share <= high for _, low, high in (wilson(int(k), count) for k in hits)]
    assert 0.92 <= np.mean(inside) <= 0.995
    assert wilson(0, 10)[2] > 0.2
    assert wilson(10, 10)[1] < 0.8


def test_targets_are_read_as_they_are_written() -> None:
    """Above, below, between."""
    assert recovery_summary.meets(0.96, ">= 0.95")
    assert not recovery_summary.meets(0.03, "<= 0.02")
    assert recovery_summary.meets(0.95, "0.92 to 0.97")
    assert not recovery_summary.meets(1.0, "0.92 to 0.97")


def test_the_paper_plant_at_one_percent_names_the_truth() -> None:
    """x2^3 is named with a sure weight, its coefficient within its interval, and the residual is the noise."""
    row = recovery.run(Cell("paper-cubic", 0.01, "unmodelled", "missing", 0))
    assert (row["status"], row["named"], row["rank"]) == ("ok", TRUTH, 1)
    assert row["exact"]
    assert row["in_plausible"]
    assert row["weight"] > 0.9
    assert row["delta2"] > 16
    assert list(row["covered"].values()) == [True]
    assert 0.9 < row["residual"] < 1.1
    assert row["ljung_box_after"] > 0.01


@pytest.mark.parametrize("condition", conditions.NULLS)
def test_a_complete_model_is_adequate(condition: str) -> None:
    """Nothing is named where nothing is missing, be the start values right or wrong."""
    row = recovery.run(Cell("paper-cubic", 0.01, "unmodelled", condition, 1))
    assert (row["status"], row["verdict"], row["named"], row["missing"]) == ("ok", "adequate", "", "")


def test_outside_takes_the_effect_and_its_look_alikes_away() -> None:
    """Neither the missing effect nor the generic term of its shape is in the library, so none can be named."""
    case, effects = plugins.cases()["paper-cubic"], plugins.effects()
    trial = conditions.trial(case, "outside", 0.05, 0, effects)
    assert {"cubic_stiffness"} <= set(effects) - set(trial.effects) < set(effects)
    row = recovery.run(Cell("paper-cubic", 0.05, "unmodelled", "outside", 0))
    assert row["status"] == "ok"
    assert TRUTH not in {row["named"], *row["plausible"]}
    assert row["missing"] == TRUTH
    assert row["delta2"] > 0


def test_start_values_are_drawn_by_what_is_stated() -> None:
    """A stated sd moves a value by about that, a fixed one stays, one without sd moves only where all are wrong."""
    case = plugins.cases()["paper-cubic"]
    a1, a2 = case.deficient.parameters.values()
    known = replace(case.deficient, parameters={"a1": replace(a1, sd=0.05), "a2": replace(a2, fixed=True)})
    moved = [
        conditions.trial(replace(case, deficient=known), "missing", 0.05, seed, plugins.effects()).model.values
        for seed in range(30)
    ]
    z = (np.array(moved)[:, 0] - a1.value) / 0.05
    assert 0.6 < np.std(z) < 1.4
    assert np.all(np.array(moved)[:, 1] == a2.value)
    right, wrong = (conditions.trial(case, name, 0.05, 3, plugins.effects()).model.values for name in conditions.NULLS)
    assert right.tolist() == case.deficient.values.tolist()
    assert np.all(wrong != case.deficient.values)


def test_spoiled_sensors_are_spoiled_as_said() -> None:
    """Coloured noise is correlated by 0.7 and has the right size, outliers are a fiftieth, sigma is off by three."""
    case, effects = plugins.cases()["paper-cubic"], plugins.effects()
    trials = {name: conditions.trial(case, name, 0.05, 0, effects) for name in conditions.SPOILED}
    e = {name: (t.record.y - t.clean) / t.sigma for name, t in trials.items()}
    assert np.std(e["coloured"]) == pytest.approx(1.0, abs=0.2)
    assert np.corrcoef(e["coloured"][1:, 0], e["coloured"][:-1, 0])[0, 1] == pytest.approx(0.7, abs=0.12)
    assert np.mean(np.abs(e["outliers"]) > 9.0) == pytest.approx(0.02, abs=0.012)
    for seed, factor in ((0, 3.0), (1, 1.0 / 3.0)):
        t = conditions.trial(case, "wrong-sigma", 0.05, seed, effects)
        stated = [output.sigma for output in t.model.outputs.values()]
        assert np.array(stated) / t.sigma == pytest.approx(factor)


def test_the_rows_of_an_effect_change_with_the_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A cell's key is stable and follows the sources of discovery, kernels and effects."""
    cell = Cell("paper-cubic", 0.05, "unmodelled", "missing", 0)
    before = hashes.Keys(None).cell(cell)
    assert hashes.Keys(None).cell(cell) == before
    (tmp_path / "extra.py").write_text("# changed\n")
    monkeypatch.setattr(hashes, "FINDING", (*hashes.FINDING, str(tmp_path)))
    assert hashes.Keys(None).cell(cell) != before


def test_plans_of_recovery_choose_conditions_that_a_case_has() -> None:
    """No measured case, no case above the bound, no condition without its effect, rivals under theirs alone."""
    chosen = plan.load("recovery")
    cells, cases = chosen.cells(), plugins.cases()
    assert {"missing", "null-right", "null-wrong", "outside"} == {cell.variant for cell in cells}
    assert all(cases[cell.case].truth is not None for cell in cells)
    assert all(len(cases[cell.case].deficient.states) <= 12 for cell in cells)
    assert {cell.variant for cell in cells if cell.estimator == "pysindy"} == {"missing"}
    assert all(cases[cell.case].missing for cell in cells if cell.variant == "missing")
    with pytest.raises(InputError, match="expected some of missing"):
        plan.parse({"kind": "recovery", "variants": ["tuned"]}, "p", "p.toml")
    with pytest.raises(InputError, match="expected one of estimation"):
        plan.parse({"kind": "guess"}, "p", "p.toml")


def test_a_killed_recovery_run_resumes_and_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Killed with -9 in the middle and started again, only what was not stored runs; then tables and figures come."""
    path, store, out = tmp_path / "p.toml", tmp_path / "r.sqlite", tmp_path / "out"
    path.write_text(
        'kind = "recovery"\ncases = ["paper-cubic"]\nestimators = ["unmodelled", "smoothed-regression"]\n'
        'variants = ["missing", "null-right"]\nnoises = [0.05]\nseeds = 2\n'
    )
    words = ["bench", "run", "--plan", str(path), "--store", str(store), "--jobs", "1", "--json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "suite", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    give_up = time.monotonic() + 200
    while time.monotonic() < give_up and process.poll() is None and not (store.exists() and _rows(store)):
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    kept = len(_rows(store))
    assert 1 <= kept < 8
    assert main(words) == 0
    done = json.loads(capsys.readouterr().out)
    assert (done["unchanged"], done["run"]) == (kept, 8 - kept)
    assert main(["bench", "recovery", "--store", str(store), "-o", str(out), "--json"]) == 0
    names = {Path(name).name for name in json.loads(capsys.readouterr().out)["files"]}
    assert {"must-reach.csv", "must-reach.parquet", "rows.json", "reliability.svg", "methods.svg"} <= names
    drawn = (out / "methods.svg").read_text()
    assert "<title>" in drawn
    assert "<desc>" in drawn
    assert main(["bench", "table", "--plan", str(path), "--store", str(store)]) == 0
    assert "true effect first at 1 % noise, all" in capsys.readouterr().out


def _rows(path: Path) -> list[dict[str, Any]]:
    with Store(path) as store:
        return store.rows()


def test_a_search_for_a_second_effect_has_a_time_of_its_own() -> None:
    """Four verdicts of a second and one of nine that fitted pairs: both within what is wanted of them."""
    rows = [*(made_up(seed=seed, depth=1) for seed in range(4)), made_up(seed=4, depth=2, cpu_seconds=9.0)]
    one, two = figure(rows, "seconds"), figure(rows, "seconds, second")
    assert (one["figure"], one["count"], one["reached"]) == (1.0, 4, True)
    assert (two["figure"], two["count"], two["reached"]) == (9.0, 1, True)
