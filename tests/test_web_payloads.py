"""What the page draws is true to the record and to the store: spikes stay, runs stand apart, gaps are gaps."""

from __future__ import annotations

import json
import math
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suite.__main__ import main
from suite.benchmark.cells import Cell, run
from suite.benchmark.store import Store
from suite.errors import InputError
from suite.model_file import from_toml
from suite.readers import read_record
from suite.record import Record, join
from suite.web import bench_tasks, opened, payloads, tasks
from suite.web.lines import line_of

DECAY = """name = "decay"
time = "t"
[states]
x = "-k*x"
[parameters]
k = 1.0
[outputs]
x = { equation = "x", sigma = 0.01 }
double = "2*x"
[units]
x = "m"
t = "s"
"""


def _silent(_: str) -> None:
    pass


def _run(N: int, start: float = 0.0) -> Record:
    t = start + np.arange(N) * 0.01
    return Record(t, np.zeros((N, 0)), np.exp(-t)[:, None], names=(f"from {start:g}",))


@pytest.mark.parametrize("N", [50, 2000, 2001, 100_000])
def test_a_spike_survives_thinning(N: int) -> None:
    """One sample of 100,000 that stands out is drawn, at its own time; so are both ends of the range."""
    record = _run(N)
    y = np.sin(record.t) + 0.0
    y[N // 3], y[2 * N // 3] = 40.0, -50.0
    drawn = payloads.trace(record, y)
    assert len(drawn["t"]) == len(drawn["y"]) <= 2000
    assert drawn["y"][drawn["t"].index(record.t[N // 3])] == 40.0
    assert drawn["y"][drawn["t"].index(record.t[2 * N // 3])] == -50.0
    assert drawn["t"] == sorted(drawn["t"])


def test_runs_follow_each_other_with_a_gap_between() -> None:
    """Runs whose clocks overlap are drawn side by side, and no line joins them."""
    record = join([_run(300), _run(200), _run(100, 50.0)])
    drawn = payloads.trace(record, record.y[:, 0])
    assert [k for k, value in enumerate(drawn["y"]) if value is None] == [300, 501]
    spans = payloads.runs(record, record.names)
    assert [span["name"] for span in spans] == ["from 0", "from 0", "from 50"]
    for before, after in pairwise(spans):
        assert before["t1"] < after["t0"]
    assert drawn["t"][301] == spans[1]["t0"]


def test_what_is_no_number_is_null() -> None:
    """JSON knows neither NaN nor infinity, however deep they stand."""
    thing = {"a": [math.nan, 1.0, {"b": -math.inf}], "c": np.array([np.inf, 2.0]), "d": np.float64("nan"), "e": None}
    assert json.loads(payloads.text(thing)) == {"a": [None, 1.0, {"b": None}], "c": [None, 2.0], "d": None, "e": None}
    record = _run(5)
    drawn = payloads.trace(record, np.array([1.0, np.nan, np.inf, 2.0, 3.0]))
    assert drawn["y"] == [1.0, None, None, 2.0, 3.0]


@pytest.fixture
def files(tmp_path: Path) -> tuple[tuple[str, str], ...]:
    """Two runs; the second starts elsewhere, and its last third departs from the model."""
    rng = np.random.default_rng(2)
    found = []
    for k, first in enumerate((1.0, 2.0)):
        t = np.arange(120) * 0.05
        x = first * np.exp(-t) + 0.01 * rng.standard_normal(120)
        x[80:] += 0.5 * k
        rows = [f"{a!r},{b!r},{2 * b!r}" for a, b in zip(t.tolist(), x.tolist(), strict=True)]
        rows[7] = rows[7].split(",")[0] + ",,"
        path = tmp_path / f"{k}.csv"
        path.write_text("\n".join(["t,x,double", *rows]) + "\n")
        found.append((str(path), f"shown{k}.csv"))
    return tuple(found)


def test_a_comparison_shows_where_it_fails(files: Any) -> None:
    """The worst interval lies where the data depart, in drawn time; units and names are the user's."""
    said = tasks.compare(DECAY, files, tell=_silent)
    assert "NaN" not in said
    step = json.loads(said)
    assert step["time"] == {"label": "t", "unit": "s"}
    assert [run["name"] for run in step["runs"]] == ["shown0.csv", "shown1.csv"]
    first = step["outputs"][0]
    assert first["unit"] == "m"
    assert len(first["worst"]) >= 1
    late = step["runs"][1]["t0"] + 80 * 0.05
    for begin, end in first["worst"]:
        assert step["runs"][1]["t0"] <= begin < end <= step["runs"][1]["t1"]
    assert any(end > late for _, end in first["worst"])
    assert None in first["measured"]["y"][:20]
    found = step["discrepancy"]
    assert found["units"] == {"x": "m", "t": "s", "x'": "m/s"}
    assert found["variables"][0]["ratio"] == max(entry["ratio"] for entry in found["variables"])
    assert set(found["run"]) == {0, 1}
    assert [entry["output"] for entry in step["whiteness"]] == ["x", "double"]


def test_errors_of_data_use_the_names_that_are_shown(files: Any, tmp_path: Path) -> None:
    """No sentence speaks of the server's own files."""
    with pytest.raises(InputError) as caught:
        tasks.compare(DECAY.replace("double", "triple"), files, tell=_silent)
    assert "shown0.csv" in str(caught.value)
    assert str(tmp_path) not in str(caught.value)


def test_the_line_of_an_error_is_found_in_every_layout() -> None:
    """Inline tables, dotted keys, quoted keys and tables of one entry."""
    for text, line in (
        ('states = { x = "-q*x" }\n', 1),
        ('name = "a"\nstates.x = "-q*x"\n', 2),
        ('[states]\n# why\n"x" = "-q*x"\n', 3),
        ('[states]\nx = "-k*x"\n[parameters.k]\nvalue = "one"\n', 3),
        ('[states]\nx = "-x"\n[outputs]\ny = { equation = "z" }\n', 4),
    ):
        with pytest.raises(InputError) as caught:
            from_toml(text, "model")
        assert line_of(text, str(caught.value)) == line, str(caught.value)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Two estimators on two cases, two seeds each."""
    path = tmp_path_factory.mktemp("bench") / "results.sqlite"
    with Store(path) as results:
        for case, estimator, seed in product(("paper-cubic", "null-oscillator"), ("ekf", "generalized-ie"), (1, 2)):
            cell = Cell(case, 0.05, estimator, "default", seed)
            results.put(cell, "key", run(cell, {}, None))
    return str(path)


def test_the_matrix_is_the_table_of_the_command(store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Every line of `bench table`, with columns that say which way is better."""
    shown = json.loads(bench_tasks.bench(store, tell=_silent))
    capsys.readouterr()
    assert main(["bench", "table", "--store", store, "--json"]) == 0
    lines = json.loads(capsys.readouterr().out)
    told = {(row["case"], row["estimator"], row["variant"]): row["state_nrmse"] for row in shown["rows"]}
    assert told == {(row["case"], row["estimator"], row["variant"]): row["state_nrmse"] for row in lines}
    assert len({row["key"] for row in shown["rows"]}) == len(shown["rows"]) >= 4
    assert {column["better"] for column in shown["columns"]} == {"low", "high", None}


def test_a_cell_opens_its_trajectories(store: str) -> None:
    """Computed again, the estimate has the error that was stored for its first seed."""
    shown = json.loads(bench_tasks.bench(store, tell=_silent))
    key = next(row["key"] for row in shown["rows"] if (row["case"], row["estimator"]) == ("paper-cubic", "ekf"))
    found = json.loads(bench_tasks.cell(store, key, tell=_silent))
    for state in found["states"]:
        truth, estimate = np.array(state["truth"]), np.array(state["estimate"])
        assert truth.shape == estimate.shape == (len(found["t"]),)
        assert np.sqrt(np.mean((truth - estimate) ** 2)) < truth.std()
    assert any(np.any(entry["truth"]) for entry in found["d"])
    assert [entry["name"] for entry in found["outputs"]]
    with pytest.raises(InputError, match="no line"):
        bench_tasks.cell(store, "../../etc/passwd", tell=_silent)


def test_a_store_that_is_none_is_refused(tmp_path: Path) -> None:
    """A file of something else is not written to."""
    other = tmp_path / "other.sqlite"
    other.write_text("not a database at all, but long enough to look at" * 100)
    with pytest.raises(InputError):
        bench_tasks.bench(str(other), tell=_silent)
    assert other.read_text().startswith("not a database")


def test_the_record_is_read_as_the_command_reads_it(files: Any) -> None:
    """Several files are several runs."""
    model, record = opened.both(DECAY, files)
    expected = read_record([path for path, _ in files], model)
    np.testing.assert_array_equal(record.y, expected.y)
    assert record.starts == expected.starts
