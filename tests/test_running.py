"""A run of the benchmark can be killed, doubled, starved, moved to a cluster: no cell is lost or repeated."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest

from suite.benchmark import cluster, pool
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task, Worker
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

    def until(self, count: int, running: subprocess.Popen[str]) -> None:
        """Wait until so many cells are computed, while the run goes on."""
        give_up = time.monotonic() + 240
        while self.computed().total() < count:
            assert running.poll() is None, running.communicate()
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
    bench.until(8, process)
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
    bench.until(4, process)
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
    assert found["y-eats"] == ("error", "memory: it took more than 600 MiB; --memory allows more")
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
    # A tracer, if there is one, would write where no file can grow.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("COV")}
    done = subprocess.run(
        [sys.executable, "-c", FILLING, str(path)], env=environment, capture_output=True, text=True, timeout=240
    )
    assert "cannot be used as a store of results" in done.stderr
    assert done.stderr.count("\n") == 1
    with Store(path) as store:
        assert [row["seed"] for row in store.rows()] == list(map(int, done.stdout.split()))


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is watched where there is /proc")
def test_the_memory_of_a_worker_is_what_is_resident() -> None:
    """The kernel's own figure, not the address space, which is many times as large."""
    worker = Worker(60.0, 1000.0)
    try:
        while not worker.ready:
            assert not isinstance(worker.look(worker.pipe.poll(0.05)), Failure)
        status = Path(f"/proc/{worker.process.pid}/status").read_text()
        (kib,) = (int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))
        assert worker.resident() == pytest.approx(kib / 1024.0, rel=0.1)
    finally:
        worker.end()
    assert worker.resident() == 0.0


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


def test_a_cluster_that_loses_a_worker_loses_no_cell(bench: Bench) -> None:
    """On a LocalCluster of processes, one killed at work: all cells are stored; a hang is a row."""
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")
    command = [sys.executable, "-c", CLUSTER]
    process = subprocess.Popen(
        command, env=bench.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdin is not None
    try:
        address = process.stdout.readline().strip()
        words = ("run", "--plan", bench.plan("y-slow", 20), "--dask", address, "--json")
        running = bench.start(*words)
        bench.until(2, running)
        with distributed.Client(address, set_as_default=False) as client:
            pids = client.run(os.getpid)
            os.kill(next(iter(pids.values())), signal.SIGKILL)
        done = json.loads(bench.done(running))
        hung = ("run", "--plan", bench.plan("y-spins", 1, limit=5.0), "--dask", address, "--json")
        failed = json.loads(bench.done(bench.start(*hung)))
    finally:
        process.stdin.close()
        process.wait(timeout=60)
        process.stdout.close()
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


def test_a_result_that_is_lost_with_its_worker_is_waited_for() -> None:
    """A task whose result went with the worker before it was fetched runs again: that result counts."""
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    again, ended = Mock(status="pending"), Mock(status="finished")
    again.exception.return_value, again.result.return_value, ended.result.return_value = None, 7, 5
    client = Mock(gather=lambda futures: [future.result() for future in futures])
    found = cluster._outcomes(client, [again, ended], "tcp://there")  # pyright: ignore[reportPrivateUsage]
    assert [outcome for _, outcome in found] == [7, 5]


def test_no_cluster_is_a_sentence(bench: Bench) -> None:
    """An address where nothing listens."""
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        list(cluster.run([Task("os:getpid", ())], "tcp://127.0.0.1:9", 1.0, 600.0))
