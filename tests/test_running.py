"""A run of the benchmark can be killed, doubled, starved, moved to a cluster, merged: no cell is lost or repeated."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from suite import plugins
from suite.benchmark import grids, pool
from suite.benchmark.cells import Cell
from suite.benchmark.collect import collect
from suite.benchmark.plan import parse
from suite.benchmark.reservations import Reservations
from suite.benchmark.store import SCHEMA, Store
from suite.benchmark.worker import Failure, Task
from suite.errors import InputError

# What a second distribution might install; a line in $CALLS says which cell was computed, by its noise's first draw.
FOREIGN = """
import os
import time

from suite.estimator import Estimate, Estimator


class Slow(Estimator):
    name = "y-slow"
    tuning = {}

    def estimate(self, model, record, pause=0.1):
        if len(record) > 20:
            time.sleep(pause)
            with open(os.environ["CALLS"], "a") as log:
                log.write(f"{record.y[0, 0]:.9f} {pause}\\n")
        return Estimate(x=record.y.copy())


class Eats(Estimator):
    name = "y-eats"

    def estimate(self, model, record):
        import numpy as np

        kept = [np.ones(2**22) for _ in range(100 * (len(record) > 20))]
        return Estimate(x=record.y.copy() + 0 * len(kept))


class Spins(Estimator):
    name = "y-spins"

    def estimate(self, model, record):
        import ctypes

        if len(record) > 20:
            # PyDLL keeps the lock of the interpreter: no Python runs in this process until it returns.
            ctypes.PyDLL(None).sleep(1000)
        return Estimate(x=record.y.copy())
"""


class Bench:
    """A folder with the foreign estimators installed in it, a plan and a store."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.store, self.calls = folder, folder / "results.sqlite", folder / "calls"
        info = folder / "foreign-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("[unmodelled.estimators]\nforeign = slow_foreign\n")
        (folder / "slow_foreign.py").write_text(FOREIGN)
        self.calls.touch()
        path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        self.environment = {**os.environ, "PYTHONPATH": path, "CALLS": str(self.calls)}

    def plan(self, estimators: str, seeds: int, limit: float = 30.0) -> str:
        path = self.folder / "plan.toml"
        opening = 'cases = ["paper-cubic"]\nnoises = [0.05]\nvariants = ["default"]\n'
        path.write_text(f'{opening}estimators = ["{estimators}"]\nseeds = {seeds}\nlimit = {limit}\n')
        return str(path)

    def start(self, *words: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "suite", "bench", *words, "--store", str(self.store)]
        return subprocess.Popen(
            command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
        )  # fmt: skip

    def done(self, process: subprocess.Popen[str], code: int = 0) -> str:
        out, err = process.communicate(timeout=240)
        assert process.returncode == code, err
        assert "Traceback" not in err
        return out if code == 0 else err

    def computed(self) -> Counter[str]:
        """How often each cell was computed to its end."""
        return Counter(self.calls.read_text().splitlines())

    def until(self, count: int) -> None:
        give_up = time.monotonic() + 120
        while self.computed().total() < count:
            assert time.monotonic() < give_up
            time.sleep(0.02)

    def rows(self) -> list[dict[str, object]]:
        with Store(self.store) as store:
            return store.rows()


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_kill_9_of_the_whole_group_loses_and_repeats_nothing(bench: Bench) -> None:
    """Parent and workers killed at once: the next run computes what is not stored, and only cells in hand twice."""
    words = ("run", "--plan", bench.plan("y-slow", 30), "--jobs", "1", "--json")
    process = bench.start(*words)
    bench.until(8)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    kept, before = len(bench.rows()), bench.computed().total()
    assert 0 < kept < 30
    assert before - kept <= 1
    done = json.loads(bench.done(bench.start(*words)))
    assert (done["unchanged"], done["run"], len(bench.rows())) == (kept, 30 - kept, 30)
    assert bench.computed().total() - before == 30 - kept


def test_two_runs_share_the_work(bench: Bench) -> None:
    """Two runs at once on one store compute every cell once between them, and both end with all of them stored."""
    words = ("run", "--plan", bench.plan("y-slow", 30), "--jobs", "1", "--json")
    runs = [bench.start(*words) for _ in range(2)]
    done = [json.loads(bench.done(process)) for process in runs]
    assert done[0]["run"] + done[1]["run"] == 30
    assert set(bench.computed().values()) == {1}
    assert len(bench.rows()) == 30


def test_an_interrupt_ends_in_a_sentence(bench: Bench) -> None:
    """Ctrl-C at the terminal, which goes to the whole group: code 130, one sentence, what was finished is stored."""
    words = ("run", "--plan", bench.plan("y-slow", 200), "--jobs", "1")
    process = bench.start(*words)
    bench.until(4)
    os.killpg(process.pid, signal.SIGINT)
    said = bench.done(process, 130)
    assert said.splitlines()[-1] == "unmodelled: stopped; what was finished is kept"
    assert 0 < len(bench.rows()) < 200
    with Store(bench.store) as store:
        assert store.execute("SELECT count(*) FROM taken").fetchone() == (0,)


def test_what_never_returns_to_python_and_what_eats_memory_is_ended(bench: Bench) -> None:
    """A call that keeps the interpreter's lock and one that takes 3 GiB are rows; a cell after them is computed."""
    bench.done(bench.start("run", "--plan", bench.plan("y-*", 1, limit=15.0), "--jobs", "1", "--memory", "600"))
    found = {row["estimator"]: (row["status"], row["reason"]) for row in bench.rows()}
    assert found["y-eats"] == ("error", "memory: it took more than 600 MiB")
    assert found["y-spins"] == ("time-out", "not done after 15 s")
    assert found["y-slow"] == ("ok", "")


FILLING = """
import resource, sys
from pathlib import Path
from suite.benchmark.cells import Cell
from suite.benchmark.store import Store
from suite.errors import InputError

resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    with Store(Path(sys.argv[1])) as store:
        for seed in range(10_000):
            store.put(Cell("c", 0.0, "e", "default", seed), "key", {"status": "ok", "reason": "x" * 100})
            print(seed)
except InputError as error:
    sys.exit(str(error))
"""


def test_a_full_disk_is_a_sentence(tmp_path: Path) -> None:
    """A store that cannot grow (a limit on the size of files stands in for the disk) says so, and keeps its rows."""
    path = tmp_path / "store"
    done = subprocess.run([sys.executable, "-c", FILLING, str(path)], capture_output=True, text=True, timeout=240)
    assert "cannot be used as a store of results" in done.stderr
    assert done.stderr.count("\n") == 1
    with Store(path) as store:
        assert [row["seed"] for row in store.rows()] == list(map(int, done.stdout.split()))


@pytest.mark.parametrize("path", ["/proc/store.sqlite", "/nowhere/store.sqlite"])
def test_a_folder_that_cannot_be_written_is_a_sentence(path: str) -> None:
    """One sentence that names the file."""
    with pytest.raises(InputError, match=path):
        Store(Path(path))


def test_a_worker_killed_at_rest_or_at_work_costs_one_task_at_most() -> None:
    """kill -9 from outside: the task at hand is a failure in words, and all other tasks are answered."""
    pids: list[int] = []

    def tasks() -> Iterator[Task | None]:
        yield Task("os:getpid", (), "first")
        yield Task("os:getpid", (), "second")
        yield Task("signal:raise_signal", (signal.SIGKILL,), "killed at work")
        yield Task("os:getpid", (), "third")
        while len(pids) < 3:
            yield None
        os.kill(pids[-1], signal.SIGKILL)
        time.sleep(0.2)
        yield Task("os:getpid", (), "fourth")

    for task, outcome in pool.run(tasks(), 1, 30.0):
        if task.label == "killed at work":
            assert outcome == Failure("error", "the process ended with code -9")
        else:
            pids.append(outcome)
    assert pids[0] == pids[1]
    assert len(set(pids)) == 3


def test_a_grid_is_a_variant_a_point() -> None:
    """The product of all values, each read back from its label; other entries keep their variants."""
    table = {
        "cases": ["paper-cubic"], "noises": [0.05], "seeds": 1, "variants": ["default"],
        "estimators": ["generalized-ie[alpha=0.1,1e3,riccati=transition,integration]", "ekf"],
    }  # fmt: skip
    cells = parse(table, "grid", "grid.toml").cells()
    labels = [cell.variant for cell in cells if cell.estimator == "generalized-ie"]
    assert [cell.variant for cell in cells if cell.estimator == "ekf"] == ["default"]
    assert [grids.values(label) for label in labels] == [
        {"alpha": alpha, "riccati": riccati} for alpha in (0.1, 1000) for riccati in ("transition", "integration")
    ]


def test_a_pattern_with_a_grid_means_those_that_take_it() -> None:
    """`*[alpha=1]` is every estimator with an alpha, and none else."""
    picked = grids.chosen(["*[alpha=1]"], plugins.estimators())
    takers = {name for name, method in plugins.estimators().items() if "alpha" in (grids.keywords(method) or ())}
    assert set(picked) == takers > {"generalized-ie"}


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("ekf[q=1]", "ekf has no keyword argument 'q'; it has q_scale"),
        ("ekf[q_scale=large]", "q_scale of ekf is a number, not 'large'"),
        ("generalized-ie[riccati=fast]", "riccati of generalized-ie is one of transition, integration, not fast"),
        ("ekf[q_scale=1", "is not a grid"),
        ("ekf[q_scale=1,q_scale=2]", "is given twice"),
        ("nothing[q_scale=1]", "no estimator is named like 'nothing'"),
    ],
)
def test_a_grid_that_no_estimator_takes_is_refused(entry: str, said: str) -> None:
    """One sentence says which keyword or value is wrong."""
    with pytest.raises(InputError, match="(?s)" + said.replace("[", r"\[").replace("'", ".")):
        parse({"estimators": [entry]}, "grid", "grid.toml").cells()


def _filled(path: Path, rows: dict[int, str], tunings: dict[str, float] | None = None) -> Path:
    with Store(path) as store:
        for seed, reason in rows.items():
            store.put(Cell("c", 0.0, "e", "default", seed), "key", {"status": "ok", "reason": reason})
        for key, value in (tunings or {}).items():
            store.put_tuning(key, {"values": {"alpha": value}})
    return path


def _reasons(store: Store) -> dict[int, str]:
    return {row["seed"]: row["reason"] for row in store.rows()}


def test_merged_stores_hold_the_newest_of_each(tmp_path: Path) -> None:
    """Whatever the order of the files, the newest row of each cell and the tunings of all are there."""
    old = _filled(tmp_path / "old", {0: "old", 1: "old"}, {"a": 1.0})
    mine = _filled(tmp_path / "mine", {1: "mine", 2: "mine"})
    new = _filled(tmp_path / "new", {2: "new", 3: "new"}, {"a": 2.0, "b": 3.0})
    with Store(mine) as store:
        assert collect(store, [new, old]) == {"cells": 3, "tunings": 2}
        assert _reasons(store) == {0: "old", 1: "mine", 2: "new", 3: "new"}
        assert store.tuning("a") == {"values": {"alpha": 2.0}}
        assert collect(store, [old, new, mine]) == {"cells": 0, "tunings": 0}


@pytest.mark.parametrize("spoil", ["text", "truncated", "schema", "other", "missing"])
def test_a_bad_store_is_refused_and_nothing_is_lost(tmp_path: Path, spoil: str) -> None:
    """After a good file a bad one: one sentence that names it, and the store is as it was."""
    good, mine = _filled(tmp_path / "good", {5: "good"}), _filled(tmp_path / "mine", {0: "mine"})
    bad = _filled(tmp_path / "bad", dict.fromkeys(range(500), "x" * 200))
    if spoil == "text":
        bad.write_text("not a database at all\n" * 100)
    elif spoil == "truncated":
        bad.write_bytes(bad.read_bytes()[:40960])
    elif spoil == "missing":
        bad.unlink()
    else:
        with sqlite3.connect(bad) as connection:
            connection.execute(f"PRAGMA user_version={SCHEMA + 1}" if spoil == "schema" else "DROP TABLE tunings")
        connection.close()
    with Store(mine) as store:
        with pytest.raises(InputError, match=str(bad)) as refused:
            collect(store, [good, bad])
        assert "\n" not in str(refused.value)
        assert _reasons(store) == {0: "mine"}
    if spoil != "missing" and spoil != "truncated":
        with pytest.raises(InputError, match=str(bad)):
            Store(bad)


def test_a_store_without_a_schema_is_taken_over(tmp_path: Path) -> None:
    """A file of the first layout, which had no number, keeps its rows and gets one."""
    path = _filled(tmp_path / "first", {0: "kept"})
    with sqlite3.connect(path) as connection:
        connection.executescript("DROP TABLE runs; DROP TABLE taken; PRAGMA user_version=0;")
    connection.close()
    with Store(path) as store:
        assert store.execute("PRAGMA user_version").fetchone() == (SCHEMA,)
        assert _reasons(store) == {0: "kept"}
        with Reservations(store) as held:
            assert held.take("a")


def test_a_silent_run_holds_nothing(tmp_path: Path) -> None:
    """What a run that lives has taken no other gets; what a dead one had is free."""
    path = tmp_path / "store"
    with Store(path) as store, Store(path) as other, Reservations(store) as mine, Reservations(other) as theirs:
        assert mine.take("a")
        assert not theirs.take("a")
        assert theirs.take("b")
        mine.give_back("a")
        assert theirs.take("a")
        store.execute("UPDATE runs SET beat = 0 WHERE run = ?", (theirs.run,))
        assert mine.take("a")


def test_a_cluster_that_loses_a_worker_loses_no_cell(bench: Bench) -> None:
    """On a LocalCluster of processes, one killed at work: all cells are stored; a hang is a row."""
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")
    cluster = [sys.executable, "-c", CLUSTER]
    process = subprocess.Popen(
        cluster, env=bench.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdin is not None
    try:
        address = process.stdout.readline().strip()
        words = ("run", "--plan", bench.plan("y-slow", 20), "--dask", address, "--json")
        running = bench.start(*words)
        bench.until(2)
        with distributed.Client(address, set_as_default=False) as client:
            pids = client.run(os.getpid)
            os.kill(next(iter(pids.values())), signal.SIGKILL)
        done = json.loads(bench.done(running))
        hung = ("run", "--plan", bench.plan("y-spins", 1, limit=5.0), "--dask", address, "--json")
        failed = json.loads(bench.done(bench.start(*hung)))
    finally:
        process.stdin.close()
        process.wait(timeout=60)
    assert done["status"] == {"ok": 20}
    assert failed["status"] == {"time-out": 1}
    assert len(bench.rows()) == 21


CLUSTER = """
import sys

if __name__ == "__main__":
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def test_no_cluster_is_a_sentence(bench: Bench) -> None:
    """An address where nothing listens."""
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    from suite.benchmark import cluster

    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        list(cluster.run([Task("os:getpid", ())], "tcp://127.0.0.1:9", 1.0, 600.0))
