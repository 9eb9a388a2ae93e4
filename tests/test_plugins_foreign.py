"""A second distribution, built and installed by pip: its plug-ins are listed, tested and judged like our own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from suite.__main__ import main
from suite.benchmark.store import Store

HERE = Path(__file__).parent / "foreign_package"
Run = Callable[..., Any]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A command of a fresh process that has the foreign distribution and one that `new` wrote installed; its JSON."""
    pytest.importorskip("hatchling", reason="the foreign package is built without the network")
    folder = tmp_path_factory.mktemp("foreign")
    assert main(["new", "estimator", "my-own", "--package", "-o", str(folder)]) == 0
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    packages = [str(HERE), str(folder / "my-own")]
    subprocess.run([*pip, "--target", str(folder / "site"), *packages], check=True, timeout=240)

    def command(*args: str) -> Any:
        done = subprocess.run(
            [sys.executable, "-m", "suite", *args, "--json"],
            cwd=folder, env={**os.environ, "PYTHONPATH": str(folder / "site")}, capture_output=True, text=True,
            check=False, timeout=240,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return command


@pytest.fixture(scope="module")
def listed(run: Run) -> Any:
    """What `list` says there."""
    return run("list")


def test_the_foreign_estimator_is_at_most_40_lines_of_plain_numpy() -> None:
    """The class and its imports fit on one screen, and know nothing of kernels."""
    text = (HERE / "alpha_beta.py").read_text(encoding="utf-8").split("class Taken")[0]
    assert len(text.rstrip().splitlines()) <= 40
    assert "kernels" not in text


def test_foreign_plug_ins_are_listed_and_those_that_fail_say_why(listed: Any) -> None:
    """Estimator, case and effect come by entry point; a lost module and a name of ours are refused, ours stays."""
    found = listed
    assert "alpha-beta" in found["estimators"]["loaded"]
    assert "leaking-tank" in found["cases"]["loaded"]
    assert "magnet" in found["effects"]["loaded"]
    reasons = found["estimators"]["failed"]
    assert "No module named" in reasons["a_module_that_is_not_there:Filter (entry point nowhere of unmodelled-foreign)"]
    taken = reasons["alpha_beta:Taken (entry point taken of unmodelled-foreign)"]
    assert taken == "the name 'ekf' is already taken, by baselines.ekf; rename one"
    assert "ekf" in found["baselines"]["loaded"]
    assert found["baselines"]["failed"] == {}


def test_foreign_plug_ins_keep_the_contract(run: Run) -> None:
    """No check of the three fails, and most apply."""
    found = run("test", "alpha-beta", "leaking-tank", "magnet")
    assert found["failed"] == 0
    assert found["passed"] >= 25


def test_the_foreign_estimator_is_in_the_matrix(run: Run, tmp_path: Path) -> None:
    """Judged in a worker process on a case of ours and on the foreign one, beside a filter of ours."""
    plan = tmp_path / "foreign.toml"
    plan.write_text(
        'cases = ["leaking-tank", "paper-cubic"]\nestimators = ["alpha-beta", "ekf"]\nvariants = ["default"]\n'
        "noises = [0.05]\nseeds = 1\n",
        encoding="utf-8",
    )
    store = str(tmp_path / "store.sqlite")
    done = run("bench", "run", "--plan", str(plan), "--store", store, "--jobs", "1")
    assert done["status"] == {"ok": 4}
    with Store(Path(store)) as kept:
        rows = kept.rows()
    assert {(row["case"], row["estimator"]) for row in rows} == {
        (case, method) for case in ("leaking-tank", "paper-cubic") for method in ("alpha-beta", "ekf")
    }
    assert all(0 < row["state_nrmse"] < 1 for row in rows)


def test_a_package_that_new_writes_is_found_when_installed(listed: Any) -> None:
    """`new --package`, pip install, `list`: the estimator is there under its name."""
    assert "my-own" in listed["estimators"]["loaded"]
