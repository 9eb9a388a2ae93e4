"""A fleet is judged file by file as each would be alone, goes on after a kill, and no file ends the run."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from suite import plugins
from suite.__main__ import main
from suite.benchmark.store import Store
from suite.discovery.verdict import diagnose
from suite.fleet import files, one, tables
from suite.model_file import read_model
from suite.readers import read_record

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
