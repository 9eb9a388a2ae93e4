"""Whatever ends a command, results are whole, what was finished is kept, and a sentence says what happened."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from suite import __main__ as command
from suite import files
from suite.benchmark import pool
from suite.benchmark.reservations import Reservations
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task
from suite.errors import InputError
from suite.files import written_whole
from suite.kernels import cache

FAULTS = Path(__file__).with_name("faults")
# Buffered, as for users: then it is at its exit that Python finds out that nobody reads.
BUFFERED = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}


def _python(code: str, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=BUFFERED
    )


WRITES = """
import sys, time
from suite import ending
from suite.files import written_whole

ending.prepare()
with written_whole(sys.argv[1]) as beside:
    beside.write_text("half of it")
    print("half", flush=True)
    time.sleep(60)
"""


def test_what_a_killed_command_was_writing_is_removed_by_the_next_one_and_nothing_else(tmp_path: Path) -> None:
    """kill -9 leaves a file beside its place; the next write in that folder removes it, not that of a living one."""
    killed, alive = _python(WRITES, str(tmp_path / "a")), _python(WRITES, str(tmp_path / "b"))
    for process in (killed, alive):
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
    killed.kill()
    killed.communicate()
    assert len(list(tmp_path.iterdir())) == 2
    files.write_whole(tmp_path / "c", "whole")
    left = [path.name for path in tmp_path.glob("*.tmp")]
    alive.terminate()
    alive.communicate()
    assert len(left) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["c"]
    assert alive.returncode == 128 + signal.SIGTERM


def test_a_figure_that_cannot_be_drawn_leaves_no_half_of_it(tmp_path: Path) -> None:
    """Both files of a figure are there, or none."""
    from matplotlib.figure import Figure

    from suite.report import bench_figures

    class Breaks(Figure):
        def savefig(self, *where: object, **how: object) -> None:  # type: ignore[override]
            if how["format"] == "png":
                raise OSError(28, "No space left on device")
            super().savefig(*where, **how)

    with pytest.raises(InputError, match="No space left"):
        bench_figures.save(Breaks(), tmp_path / "figure")
    assert list(tmp_path.iterdir()) == []


def test_an_error_without_a_number_has_its_words(tmp_path: Path) -> None:
    """Libraries raise OSErrors with a text alone."""
    with pytest.raises(InputError, match=r"a: cannot be written \(the disk is odd\)"), written_whole(tmp_path / "a"):
        raise OSError("the disk is odd")


@pytest.mark.parametrize("hours", [-3, 3])
def test_a_dead_run_holds_nothing_whichever_way_the_clock_was_set(tmp_path: Path, hours: int) -> None:
    """A beat of the past, or one in the future because the clock was set back since, is that of a dead run."""
    with Store(tmp_path / "store") as store, Reservations(store) as mine:
        store.execute("INSERT INTO runs VALUES ('dead', ?)", (time.time() + 3600.0 * hours,))
        store.execute("INSERT INTO taken VALUES ('a', 'dead')")
        assert mine.take("a")
        store.execute("INSERT INTO taken VALUES ('b', 'dead')")
        with Reservations(store):
            assert store.all("SELECT * FROM runs WHERE run = 'dead'") == []
            assert store.all("SELECT key FROM taken") == [("a",)]


OPENS = """
import sys, time
from pathlib import Path
from suite.benchmark.store import Store

print("ready", flush=True)
sys.stdin.readline()
for k in range(20):
    with Store(Path(sys.argv[1]) / f"{k}.sqlite") as store:
        store.put_tuning(sys.argv[2], {"values": {}})
"""


def test_several_may_make_a_store_in_the_same_moment(tmp_path: Path) -> None:
    """None is told that the database is locked, and what each put is there."""
    making = [
        subprocess.Popen(
            [sys.executable, "-c", OPENS, str(tmp_path), str(k)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )
        for k in range(4)
    ]  # fmt: skip
    for process in making:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in making:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in making:
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
    for path in tmp_path.glob("*.sqlite"):
        with Store(path) as store:
            assert store.all("SELECT count(*) FROM tunings") == [(4,)]


def test_a_worker_killed_at_work_costs_no_result() -> None:
    """Its task has another process; only where that is killed too is it a failure."""

    def tasks() -> Iterator[Task | None]:
        yield Task("os:getpid", ())
        while not found:
            yield None
        threading.Timer(0.5, os.kill, (found[0], signal.SIGKILL)).start()
        yield Task("time:sleep", (1.5,))

    found: list[object] = []
    for _, outcome in pool.run(tasks(), 1, 60.0):
        found.append(outcome)
    assert len(found) == 2
    assert not isinstance(found[1], Failure)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_streams_that_are_full_closed_or_not_read_end_in_an_exit_code(tmp_path: Path) -> None:
    """A full disk is a sentence and 2, a reader that has gone is 0, and no word comes from Python itself."""
    python = f"{sys.executable} -m suite"
    for words, code, said in (
        ("--help > /dev/full", 2, "No space left"),
        (f"new estimator mine -o {tmp_path} > /dev/full", 2, "No space left"),
        ("--help >&- 2>&- <&-", 0, ""),
        ("new estimator 1 2> /dev/full", 2, ""),
        ("new estimator 1 2>&-", 2, ""),
    ):
        done = subprocess.run(f"{python} {words}", shell=True, capture_output=True, text=True, env=BUFFERED)
        assert done.returncode == code, words
        assert (said in done.stderr) if said else done.stderr == "", words
        assert done.stderr.count("\n") <= 1
    gone, mouth = os.pipe()
    os.close(gone)
    done = subprocess.run([*python.split(), "--help"], stdout=mouth, stderr=subprocess.PIPE, text=True, env=BUFFERED)
    os.close(mouth)
    assert (done.returncode, done.stderr) == (0, "")


def test_memory_that_ends_is_a_sentence(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, not a traceback."""

    def ends(args: object) -> int:
        raise MemoryError

    monkeypatch.setattr(command, "_run", ends)
    assert command.main(["list"]) == 2
    assert capsys.readouterr().err.startswith("unmodelled: memory: there is not enough")


def test_a_user_without_a_home_needs_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """Path.home() raises for a user without an entry, as in some containers."""

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("UNMODELLED_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    cache._cannot_be_kept.cache_clear()
    with pytest.warns(RuntimeWarning, match="the user has no home"):
        assert cache.folder.__wrapped__() is None


KERNEL = """
from suite.kernels.cache import compile_kernel, numba

@compile_kernel(numba.float64(numba.float64))
def twice(x):
    return 2.0 * x
"""
FULL = """
import resource, sys, warnings

resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    sys.path.insert(0, sys.argv[1])
    import kernel
print(kernel.twice(21.0), [str(w.message)[:28] for w in caught if "compiled code" in str(w.message)])
"""


def test_an_empty_home_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python takes it for the root folder, where nothing of ours belongs, also where it may be written."""
    for name in ("HOME", "XDG_CACHE_HOME", "UNMODELLED_CACHE"):
        monkeypatch.setenv(name, "")
    cache._cannot_be_kept.cache_clear()
    with pytest.warns(RuntimeWarning, match="the user has no home"):
        assert cache.folder.__wrapped__() is None


def test_a_full_disk_for_compiled_code_costs_time_alone(tmp_path: Path) -> None:
    """A kernel that cannot be kept works, with one note (a limit on the size of files stands in for the disk)."""
    pytest.importorskip("resource", reason="no limits on the size of files here")
    (tmp_path / "kernel.py").write_text(KERNEL)
    code = f"import os; os.environ['UNMODELLED_CACHE'] = {str(tmp_path / 'cache')!r}" + FULL
    out, err = _python(code, str(tmp_path)).communicate(timeout=120)
    assert out == "42.0 ['compiled code cannot be kept']\n", err


WRITING = re.compile(
    r"([\w)]+)\.(?:write_text|write_bytes|open\(\"[wax])|(?:savefig|to_csv|to_parquet|ParquetWriter)\((\w+)"
)
# What `written_whole` gives, and what is in memory.
BESIDE = {"beside", "fresh", "drawn", "dots", "binary", "buffer"}


def test_every_file_of_a_result_is_written_beside_its_place() -> None:
    """A kill would leave half a file there; what the page is sent (`uploads`) is in a folder that ends with it."""
    direct = []
    for path in Path(files.__file__).parent.rglob("*.py"):
        for line in path.read_text(encoding="utf-8").splitlines() if path.name != "uploads.py" else ():
            named = [receiver or argument for receiver, argument in WRITING.findall(line)]
            direct += [f"{path.name}: {line.strip()}" for name in named if name not in BESIDE]
    assert direct == []


def test_the_table_of_the_page_is_that_of_the_report() -> None:
    """docs/faults.md shows results/faults.json, in which no fault is left."""
    root = FAULTS.parents[1]
    page, report = root / "docs" / "faults.md", root / "results" / "faults.json"
    if not page.is_file():
        pytest.skip("the documentation is in a checkout, not beside an installed package")
    words = [sys.executable, str(FAULTS / "summary.py"), str(report)]
    shown = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert shown in page.read_text(encoding="utf-8")
    found = json.loads(report.read_text(encoding="utf-8"))["scenarios"]
    assert not any(entry["faults"] for entry in found)
