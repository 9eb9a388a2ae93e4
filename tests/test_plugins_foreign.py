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

HERE = Path(__file__).parent / "foreign_package"
Run = Callable[..., Any]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A command of a fresh process that has the foreign distribution installed; its JSON."""
    pytest.importorskip("hatchling", reason="the foreign package is built without the network")
    folder = tmp_path_factory.mktemp("foreign")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(folder / "site"), str(HERE)], check=True, timeout=120)

    def command(*args: str) -> Any:
        done = subprocess.run(
            [sys.executable, "-m", "suite", *args, "--json"],
            cwd=folder, env={**os.environ, "PYTHONPATH": str(folder / "site")}, capture_output=True, text=True,
            check=False, timeout=240,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return command


def test_the_foreign_estimator_is_at_most_40_lines_of_plain_numpy() -> None:
    """The class and its imports fit on one screen, and know nothing of kernels."""
    text = (HERE / "alpha_beta.py").read_text(encoding="utf-8").split("class Taken")[0]
    assert len(text.rstrip().splitlines()) <= 40
    assert "kernels" not in text


def test_foreign_plug_ins_are_listed_and_those_that_fail_say_why(run: Run) -> None:
    """Estimator, case and effect come by entry point; a lost module and a name of ours are refused, ours stays."""
    found = run("list")
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
    """Judged in worker processes on a case of ours and on the foreign one, beside a filter of ours."""
    plan = tmp_path / "foreign.toml"
    plan.write_text(
        'cases = ["leaking-tank", "paper-cubic"]\nestimators = ["alpha-beta", "ekf"]\nvariants = ["default"]\n'
        "noises = [0.05]\nseeds = 1\n",
        encoding="utf-8",
    )
    store = str(tmp_path / "store.sqlite")
    done = run("bench", "run", "--plan", str(plan), "--store", store, "--jobs", "2")
    assert done["status"] == {"ok": 4}
    rows = run("bench", "table", "--store", store, "--rows")
    assert {(row["case"], row["estimator"]) for row in rows} == {
        (case, method) for case in ("leaking-tank", "paper-cubic") for method in ("alpha-beta", "ekf")
    }
    assert all(0 < row["state_nrmse"] < 1 for row in rows)


def test_a_package_that_new_writes_is_found_when_installed(tmp_path: Path) -> None:
    """`new --package`, pip install, `list`: the estimator is there under its name."""
    pytest.importorskip("hatchling", reason="the package is built without the network")
    new = [sys.executable, "-m", "suite", "new", "estimator", "my-own", "--package", "-o", str(tmp_path)]
    subprocess.run(new, check=True, cwd=tmp_path, timeout=60, capture_output=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(tmp_path / "site"), str(tmp_path / "my-own")], check=True, timeout=120)
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    listed = subprocess.run(
        [sys.executable, "-m", "suite", "list", "--json"],
        cwd=tmp_path, env=env, capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert "my-own" in json.loads(listed.stdout)["estimators"]["loaded"]
