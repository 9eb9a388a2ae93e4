"""A fleet is judged file by file as each would be alone, goes on after a kill, and no file ends the run."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import pytest

from suite import plugins
from suite.__main__ import main
from suite.benchmark import pool
from suite.benchmark.driving import Driving
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task
from suite.discovery.verdict import diagnose
from suite.errors import InputError
from suite.fleet import files, one, ranking, tables
from suite.fleet import run as fleet
from suite.fleet.stored import Brief
from suite.model import Model
from suite.model_file import read_model
from suite.readers import read_record
from suite.report import fleet_page

ROOT = Path(__file__).parents[1]
KINDS = [2, 0, 1, 0, 3]  # of the machines that are judged, by their numbers; see bench/machines.py
ODD = {"broken.csv": "t;force;pos\nnot;a;number\n", "empty.csv": ""}
OWN = ["seconds", "peak_mb"]  # columns that differ from run to run

pytestmark = pytest.mark.skipif(
    not (ROOT / "bench").is_dir(), reason="the simulated fleet is in a checkout, not beside an installed package"
)


def bench(name: str) -> ModuleType:
    """A file of bench/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "bench" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """model.toml, and in logs/ five machines and two files that hold no record."""
    place = tmp_path_factory.mktemp("fleet")
    bench("machines").write(place, np.array(KINDS), seed=3)
    for name, text in ODD.items():
        (place / "logs" / name).write_text(text)
    return place


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    """`unmodelled diagnose model.toml ... --each` in the folder, in a group of its own."""
    command = [sys.executable, "-m", "suite", "diagnose", "model.toml", *words, "--each"]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def done(process: subprocess.Popen[str], code: int = 0) -> tuple[str, str]:
    """Standard output and error of what ends with this code."""
    out, err = process.communicate(timeout=900)
    assert process.returncode == code, err
    assert "Traceback" not in err
    return out, err


@pytest.fixture(scope="module")
def judged(folder: Path) -> tuple[Path, str, str]:
    """The folder of the results of two processes on all files and one that is not there, and what the terminal said."""
    out, err = done(start(folder, "logs/*.csv", "logs/gone.csv", "-o", "out", "--jobs", "2"))
    return folder / "out", out, err


def table(out: Path) -> pd.DataFrame:
    return pd.read_parquet(out / "fleet.parquet").set_index("file").sort_index()


def test_verdicts_are_those_of_each_file_alone(folder: Path, judged: tuple[Path, str, str]) -> None:
    """Every number and word of a row is that of `diagnose` on the file, to the last digit."""
    found, model = table(judged[0]), read_model(folder / "model.toml")
    rows = found[found.status == "ok"]
    assert len(rows) == len(KINDS)
    for file, row in rows.iterrows():
        record = read_record(folder / str(file), model)
        alone = one.said(diagnose(model, record, plugins.effects()), record)
        for name, value in alone.items():
            for column, number in {f"{name}.pos": value["pos"]}.items() if isinstance(value, dict) else [(name, value)]:
                assert column in OWN or row[column] == number, (file, column)


def test_what_machines_lack_is_found_and_ranked(judged: tuple[Path, str, str]) -> None:
    """The effects that were simulated are named; the rank is that of the error over noise; both tables are the same."""
    found = table(judged[0])
    effects = [found.effects[f"logs/machine-{k:05d}.csv"].partition("@")[0] for k in range(len(KINDS))]
    assert effects == ["cubic_stiffness", "", "coulomb_friction", "", "quadratic_drag"]
    ranks = found["rank"].dropna().sort_values()
    assert ranks.tolist() == [1, 2, 3, 4, 5]
    assert found.ratio[ranks.index].is_monotonic_decreasing
    text = pd.read_csv(judged[0] / "fleet.csv", keep_default_na=False, dtype=str)
    assert text["rank"].tolist() == ["1", "2", "3", "4", "5", "", "", ""]
    assert list(text) == list(tables.names(["pos"])) == ["rank", "file", *list(found)[1:]]


def test_a_file_that_cannot_be_judged_is_a_row_with_a_sentence(judged: tuple[Path, str, str]) -> None:
    """Text, nothing, and no file: each has its reason in the table, on the terminal and in the report."""
    folder, out, _ = judged
    found = table(folder)
    refused = found[found.status == "refused"]
    assert [Path(str(file)).name for file in refused.index] == ["broken.csv", "empty.csv", "gone.csv"]
    assert "the file is empty" in refused.reason["logs/empty.csv"]
    assert "no such file" in refused.reason["logs/gone.csv"]
    assert refused[["rank", "ratio", "weight"]].isna().all().all()
    page = (folder / "report.html").read_text(encoding="utf-8")
    for said in (out, page):
        assert "3 could not be judged." in said
        assert "no such file" in said
    assert "<script" not in page


def test_the_terminal_says_how_far_it_is_and_where_everything_lies(judged: tuple[Path, str, str]) -> None:
    """Progress goes to standard error; the sentence comes first, no machine that is right is among the worst."""
    folder, out, err = judged
    assert "files: 8 of 8" in err
    assert out.startswith("Of 8 machines, 2 follow the model; ")
    assert "8 files: 0 unchanged, 8 run (5 ok, 3 refused)" in out
    assert "adequate" not in out
    for name in ("report.html", "fleet.parquet", "fleet.csv"):
        assert f"out/{name}" in out
        assert (folder / name).is_file()


def test_kill_9_loses_nothing_and_repeats_nothing(folder: Path, judged: tuple[Path, str, str]) -> None:
    """What was stored when all processes were killed stays as it is; in the end one process has said what two did."""
    words = ("logs/*.csv", "logs/gone.csv", "-o", "killed", "--jobs", "1", "--json")
    running, path = start(folder, *words), folder / "killed" / "fleet.sqlite"
    try:
        while not _whens(path):
            assert running.poll() is None, running.communicate()
            time.sleep(0.02)
    finally:
        os.killpg(running.pid, signal.SIGKILL)
        running.communicate()
    before = _whens(path)
    assert 0 < len(before) < 8
    out, err = done(start(folder, *words))
    told = json.loads(out)
    assert (told["files"], told["unchanged"], told["run"]) == (8, len(before), 8 - len(before))
    assert not err
    after = _whens(path)
    assert {place: after[place] for place in before} == before
    pd.testing.assert_frame_equal(
        table(folder / "killed").drop(columns=OWN), table(judged[0]).drop(columns=OWN), check_exact=True
    )


def _whens(path: Path) -> dict[str, float]:
    """When the row of each file was stored."""
    if not path.is_file():
        return {}
    with Store(path) as store:
        return dict(store.all('SELECT "case", "when" FROM cells'))


def test_a_cluster_says_the_same(
    folder: Path, judged: tuple[Path, str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Two files on a Dask cluster of one process."""
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    command = [sys.executable, "-c", CLUSTER]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        names = [str(folder / "logs" / name) for name in ("machine-00002.csv", "empty.csv")]
        words = ["diagnose", str(folder / "model.toml"), *names, "--each", "--json", "--dask", address]
        assert main([*words, "-o", str(folder / "dask")]) == 0
    finally:
        process.communicate(timeout=60)
    assert json.loads(capsys.readouterr().out)["status"] == {"ok": 1, "refused": 1}
    ours, theirs = (frame.drop(columns=[*OWN, "rank"]) for frame in (table(judged[0]), table(folder / "dask")))
    theirs.index = theirs.index.map(lambda name: f"logs/{Path(name).name}")
    pd.testing.assert_frame_equal(theirs, ours.loc[theirs.index], check_exact=True)


CLUSTER = """
import sys

if __name__ == "__main__":
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def test_a_limit_that_is_met_is_a_row(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that is not done in its time has that for a reason; a fleet without any verdict is exit code 2."""
    words = ["diagnose", str(folder / "model.toml"), str(folder / "logs" / "machine-00002.csv"), "--each"]
    assert main([*words, "-o", str(tmp_path), "--limit", "0.01", "--jobs", "1"]) == 2
    row = table(tmp_path).iloc[0]
    assert (row.status, row.reason) == ("time-out", "not done after 0.01 s")
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("unmodelled: none of 1 files could be judged; the first, ")
    assert (tmp_path / "report.html").is_file()


class Here:
    """Stands in for the processes: each file is judged at once, in words that need no numerics.

    `seen` counts the files judged; `failing` gives what becomes of a file instead, `meanwhile` is done at each.
    """

    def __init__(self) -> None:
        self.seen: Counter[str] = Counter()
        self.failing: dict[str, Failure] = {}
        self.meanwhile: Callable[[Path], None] = lambda path: None

    def run(self, tasks: Iterable[Task | None], jobs: int, limit: float, memory: float) -> Iterator[tuple[Task, Any]]:
        for task in tasks:
            if task is None:
                time.sleep(0.01)
                continue
            path = Path(task.label)
            row = {**dict.fromkeys(one.TEXTS, ""), "status": "ok", "reason": "", "digest": one.digest(str(path))}
            self.seen[path.name] += 1
            self.meanwhile(path)
            yield task, self.failing.get(path.name, {**row, "verdict": "adequate", "weight": 0.0, "ratio": 1.0})


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Here:
    stand_in = Here()
    monkeypatch.setattr(pool, "run", stand_in.run)
    return stand_in


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    paths = [tmp_path / f"{name}.csv" for name in "abc"]
    for path in paths:
        path.write_text(f"of {path.name}")
    return paths


@pytest.fixture
def model(folder: Path) -> Model:
    return read_model(folder / "model.toml")


def judge(paths: Iterable[Path], model: Model, limit: float = 10.0, **more: Any) -> tuple[int, int]:
    """How many files were run and how many were unchanged; the store is beside the files."""
    paths = list(paths)
    asked = fleet.Asked(model, "model.toml", more.pop("absolute", False))
    with Store(paths[0].parent / "fleet.sqlite", elsewhere="name another folder with -o") as store:
        ended = fleet.run(files.chosen(list(map(str, paths))), asked, store, Driving(1, limit, quiet=True, **more))
    assert sorted(brief.file for brief in ended.briefs) == sorted(map(str, paths))
    return ended.run, ended.unchanged


def test_only_what_has_changed_is_judged_again(here: Here, logs: list[Path], model: Model) -> None:
    """Other bytes, another model, other options: again. The same bytes at another time: not."""
    assert judge(logs, model) == (3, 0)
    assert judge(logs, model) == (0, 3)
    os.utime(logs[0], (1.0, 1.0))
    logs[1].write_text("changed")
    assert judge(logs, model) == (1, 2)
    assert here.seen == {"a.csv": 1, "b.csv": 2, "c.csv": 1}
    assert judge(logs[:2], model) == (0, 2)
    other = replace(model, parameters={**model.parameters, "k": replace(model.parameters["k"], value=5.0)})
    assert judge(logs, other) == (3, 0)
    assert judge(logs, other, absolute=True) == (3, 0)
    assert judge(logs, other, absolute=True, force=True) == (3, 0)
    logs[2].unlink()
    assert judge(logs, other, absolute=True) == (1, 2)


def test_a_file_that_met_a_limit_is_judged_again_under_a_wider_one(here: Here, logs: list[Path], model: Model) -> None:
    """Not under the same or a narrower one; nor once it has a verdict."""
    here.failing["b.csv"] = Failure("time-out", "not done after 10 s")
    assert judge(logs, model) == (3, 0)
    assert judge(logs, model) == (0, 3)
    assert judge(logs, model, limit=5.0) == (0, 3)
    assert judge(logs, model, memory=2000.0) == (1, 2)
    del here.failing["b.csv"]
    assert judge(logs, model, limit=20.0) == (1, 2)
    assert judge(logs, model, limit=40.0) == (0, 3)


def test_a_file_that_was_written_to_while_it_was_judged_is_judged_again(
    here: Here, logs: list[Path], model: Model
) -> None:
    """The row is that of what was read, and the next run sees that this is no more what is there."""
    here.meanwhile = lambda path: _append(path) if path.name == "b.csv" else None
    assert judge(logs, model) == (3, 0)
    here.meanwhile = lambda path: None
    assert judge(logs, model) == (1, 2)
    assert judge(logs, model) == (0, 3)


def _append(path: Path) -> None:
    path.write_text(path.read_text() + "more")


def test_two_runs_at_once_share_the_files(here: Here, tmp_path: Path, model: Model) -> None:
    """Each file is judged once, by either run, and both end with all of them."""
    paths = [tmp_path / f"{k}.csv" for k in range(40)]
    for path in paths:
        path.write_text(path.name)
    here.meanwhile = lambda path: time.sleep(0.01)
    ended: list[tuple[int, int]] = []
    both = [threading.Thread(target=lambda: ended.append(judge(paths, model))) for _ in range(2)]
    for run in both:
        run.start()
    for run in both:
        run.join()
    assert sum(run for run, _ in ended) == 40
    assert min(run for run, _ in ended) > 0
    assert set(here.seen.values()) == {1}


def test_a_run_with_another_model_on_the_same_folder_is_said(here: Here, logs: list[Path], model: Model) -> None:
    """Its verdicts replace ours while we run: a sentence, and no table of two models."""
    other = replace(model, parameters={**model.parameters, "k": replace(model.parameters["k"], value=5.0)})

    def meanwhile(path: Path) -> None:
        here.meanwhile = lambda path: None
        judge(logs, other)

    judge(logs[:1], model)
    here.meanwhile = meanwhile
    with pytest.raises(InputError, match="another model or other options; name another folder with -o"):
        judge(logs, model)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["logs/*.xyz", "--each", "-o", "out"], "no file is like 'logs/*.xyz'"),
        (
            ["logs", "--each", "-o", "out"],
            "logs: is a folder; with --each give files or a pattern, such as 'logs/*.csv'",
        ),
        (["logs/*.csv", "--each"], "--each needs a folder for its table and report: add -o DIR"),
        (["logs/empty.csv", "--jobs", "2"], "--jobs goes with --each"),
        (["logs/*.csv", "--each", "-o", "/proc/fleet"], "/proc/fleet: cannot be written"),
        (["logs/*.csv", "--each", "-o", "model.toml"], "model.toml: is a file, not a folder"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(
    folder: Path, words: list[str], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, before anything is run or written."""
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    assert main(["diagnose", "model.toml", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert sorted(folder.iterdir()) == before


def test_a_pattern_takes_no_table_of_ours(tmp_path: Path) -> None:
    """Results among the logs are no logs; a name twice is one file."""
    for name in ("a.csv", "fleet.csv"):
        (tmp_path / name).touch()
    chosen = files.chosen([f"{tmp_path}/*.csv", f"{tmp_path}/a.csv"], [tmp_path / "fleet.csv"])
    assert list(chosen.values()) == [f"{tmp_path}/a.csv"]


def brief(file: str, verdict: str, effects: str = "", ratio: float = 1.0, weight: float = 0.0) -> Brief:
    return Brief(f"/{file}", file, "ok" if verdict else "refused", "", verdict, effects, weight, ratio)


def test_the_worst_comes_first_and_what_is_not_judged_last() -> None:
    """What ran away is worst; the weight decides between equals; the sentence counts everyone once."""
    given = [
        brief("a", ""),
        brief("b", "adequate", ratio=1.01),
        brief("c", "missing_effect", "x@v", 3.0, 0.9),
        brief("d", "ambiguous", "y@v", 3.0, 0.95),
        brief("e", "unexplained", ratio=math.inf),
    ]
    ranking_ = ranking.ranked(given)
    assert "".join(entry.file for entry in ranking_) == "edcba"
    assert len(ranking.judged(ranking_)) == 4
    assert ranking.sentence(ranking_) == (
        "Of 5 machines, 1 follows the model; 1 lacks x in v; "
        "1 lacks an effect not told from others, most likely y in v; "
        "1 fails in a way that the library does not explain; 1 could not be judged."
    )


def test_the_report_of_ten_thousand_machines_stays_small(tmp_path: Path, model: Model) -> None:
    """Below 2 MB, also where every other file fails for a reason of its own; names are text, never markup."""
    given = [brief(f"<b>{k}.csv", "missing_effect", f"effect_{k % 40}@v", 1.0 + k, 0.9) for k in range(5000)]
    given += [replace(brief(f"{k}", ""), reason="word " * 50 + "x" * (k % 100)) for k in range(5000)]
    briefs = ranking.ranked(given)
    shown: dict[str, Any] = {"plausible": "", "coefficients": "[]"}
    fleet_page.write(briefs, [shown] * fleet_page.SHOWN, model, "unmodelled", tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert len(page) < 2_000_000
    assert "<b>" not in page


def test_every_column_is_described() -> None:
    """docs/fleet.md says what each column means."""
    page = (ROOT / "docs" / "fleet.md").read_text(encoding="utf-8")
    for name, _, meaning in tables.COLUMNS:
        assert f"| `{name}` | {meaning} |" in page
    for name, meaning in tables.EACH:
        assert f"| `{name}.OUTPUT` | {meaning} |" in page


def test_the_pages_figures_are_the_measured_ones() -> None:
    """Mend by `python bench/fleet_page.py results/fleet/throughput.json docs/fleet.md`."""
    stored, page = ROOT / "results" / "fleet" / "throughput.json", ROOT / "docs" / "fleet.md"
    text = page.read_text(encoding="utf-8")
    if stored.is_file():
        assert bench("fleet_page").with_tables(text, json.loads(stored.read_text(encoding="utf-8"))) == text
    else:
        assert "files a second" not in text
