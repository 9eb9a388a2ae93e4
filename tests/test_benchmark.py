"""A run of the benchmark loses nothing and hides no failure, whatever an estimator or the machine does."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from suite.benchmark.store import Store

# Foreign estimators that come by entry point, as another distribution's would; each call leaves a line in a log.
FOREIGN = """
import abc
import os
import time

import numpy as np

from suite.estimator import Estimate, Estimator


class _Logged(Estimator):
    def estimate(self, model, record):
        if len(record) > 20:
            with open(os.environ["CALLS"], "a") as log:
                log.write(self.name + "\\n")
        return self.answer(record)

    @abc.abstractmethod
    def answer(self, record): ...


class Follows(_Logged):
    name = "x-follows"

    def answer(self, record):
        time.sleep(0.05)
        return Estimate(x=record.y.copy())


class Raises(_Logged):
    name = "x-raises"

    def answer(self, record):
        raise ZeroDivisionError("on purpose")


class Hangs(_Logged):
    name = "x-hangs"

    def answer(self, record):
        while len(record) > 20:
            pass
        return Estimate(x=record.y.copy())


class Dies(_Logged):
    name = "x-dies"

    def answer(self, record):
        if len(record) > 20:
            os._exit(3)
        return Estimate(x=record.y.copy())


class Leaves(_Logged):
    name = "x-leaves"

    def answer(self, record):
        x = record.y.copy()
        x[100:] = np.nan
        return Estimate(x=x)


class Abstains(_Logged):
    name = "x-abstains"

    def skip(self, model, record):
        return "it rains"

    def answer(self, record):
        raise AssertionError
"""

DRIVER = """
import argparse, sys
from suite.bench_verbs import add_parser, run

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers(dest="verb"))
    sys.exit(run(parser.parse_args()))
"""


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """A folder with the foreign estimators installed in it and a driver of the commands."""
    return Bench(tmp_path)


class Bench:
    def __init__(self, folder: Path) -> None:
        self.folder, self.store, self.calls = folder, folder / "results.sqlite", folder / "calls"
        info = folder / "foreign-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("[unmodelled.estimators]\nforeign = foreign\n")
        (folder / "foreign.py").write_text(FOREIGN)
        (folder / "driver.py").write_text(DRIVER)
        self.calls.touch()
        path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        self.environment = {**os.environ, "PYTHONPATH": path, "CALLS": str(self.calls)}

    def plan(self, estimators: str, seeds: int, limit: float = 30.0) -> str:
        path = self.folder / "plan.toml"
        opening = 'cases = ["paper-cubic"]\nnoises = [0.05]\n'
        path.write_text(f'{opening}estimators = ["{estimators}"]\nseeds = {seeds}\nlimit = {limit}\n')
        return str(path)

    def start(self, *words: str) -> subprocess.Popen[str]:
        command = [sys.executable, str(self.folder / "driver.py"), "bench", *words, "--store", str(self.store)]
        return subprocess.Popen(
            command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def run(self, *words: str) -> str:
        process = self.start(*words)
        out, err = process.communicate(timeout=240)
        assert process.returncode == 0, err
        return out

    def rows(self) -> list[dict[str, object]]:
        with Store(self.store) as store:
            return store.rows()


def test_every_failure_is_a_row_with_its_reason(bench: Bench) -> None:
    """A cell that raises, hangs, dies, leaves the finite numbers or abstains is a row that says so in words."""
    bench.run("run", "--plan", bench.plan("x-*", 1, limit=20.0), "--jobs", "2")
    found = {row["estimator"]: (row["status"], row["reason"]) for row in bench.rows()}
    assert found["x-follows"] == ("ok", "")
    assert found["x-raises"] == ("error", "ZeroDivisionError: on purpose")
    assert found["x-hangs"] == ("time-out", "not done after 20 s")
    assert found["x-dies"] == ("error", "the process ended with code 3")
    assert found["x-leaves"] == ("diverged", "the state is not finite from t = 5 on")
    assert found["x-abstains"] == ("skipped", "it rains")


def test_a_killed_run_resumes_where_it_was(bench: Bench) -> None:
    """Killed with -9 in the middle and started again, every cell is there, and only cells in hand ran twice."""
    words = ("run", "--plan", bench.plan("x-follows", 30), "--jobs", "1", "--json")
    process = bench.start(*words)
    give_up = time.monotonic() + 120
    while len(bench.calls.read_text().splitlines()) < 5 and time.monotonic() < give_up:
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    time.sleep(1.0)  # the orphaned worker notices and ends
    kept, before = len(bench.rows()), len(bench.calls.read_text().splitlines())
    assert 0 < kept < 30
    done = json.loads(bench.run(*words))
    assert (done["unchanged"], done["run"]) == (kept, 30 - kept)
    assert len(bench.rows()) == 30
    after = len(bench.calls.read_text().splitlines())
    assert after - before == 30 - kept
    assert before - kept <= 2
    assert json.loads(bench.run(*words))["run"] == 0


def test_a_changed_plug_in_runs_again(bench: Bench) -> None:
    """Editing an estimator's code makes its cells run again; a comment changes no number."""
    words = ("run", "--plan", bench.plan("x-follows", 2), "--jobs", "1", "--json")
    assert json.loads(bench.run(*words))["run"] == 2
    (bench.folder / "foreign.py").write_text(FOREIGN + "\n# a comment\n")
    assert json.loads(bench.run(*words))["run"] == 0
    (bench.folder / "foreign.py").write_text(FOREIGN + "\nCHANGED = 1\n")
    assert json.loads(bench.run(*words))["run"] == 2


def test_two_writers_share_a_store(tmp_path: Path) -> None:
    """Two processes that write to one store at once lose no row."""
    script = (
        "import sys\nfrom pathlib import Path\nfrom suite.benchmark.cells import Cell\n"
        "from suite.benchmark.store import Store\n"
        "with Store(Path(sys.argv[1])) as store:\n    for seed in range(200):\n"
        "        store.put(Cell('c', 0.0, sys.argv[2], 'default', seed), 'key', {'status': 'ok', 'reason': ''})\n"
    )
    path = tmp_path / "shared.sqlite"
    writers = [subprocess.Popen([sys.executable, "-c", script, str(path), name]) for name in ("a", "b")]
    assert [writer.wait(timeout=120) for writer in writers] == [0, 0]
    with Store(path) as store:
        assert len(store.rows()) == 400
