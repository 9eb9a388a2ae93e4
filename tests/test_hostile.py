"""Hostile and broken input ends in one sentence, soon, in little memory, and touches nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from suite.benchmark import grids, plan
from suite.benchmark.cells import Cell
from suite.benchmark.store import Store
from suite.errors import LONGEST, InputError
from suite.model import Input, Model, Output
from suite.model_file import from_toml
from suite.readers import read_record

MODEL = Model("plant", {"x": "-x + u"}, inputs={"u": Input("u")}, outputs={"y": Output("x", "y")})
FUZZ = Path(__file__).with_name("fuzz")


def test_a_sentence_is_one_line_however_long_or_odd_what_it_quotes() -> None:
    """Control characters are shown as codes; the mend at the end stays."""
    said = str(InputError("a" * 5000 + "\x1b[31m\n; mend that"))
    assert len(said) <= LONGEST
    assert said.isprintable()
    assert said.endswith("; mend that")


def test_a_key_of_very_many_parts_is_refused() -> None:
    """Reading it takes time with the square of its parts."""
    with pytest.raises(InputError, match=r"more than 100 parts \(at line 2\)"):
        from_toml("\n" + "a." * 120_000 + "b = 1")


@pytest.mark.parametrize("text", ["a" * 140_000 + ",u,y\n1,2,3\n", "t,u,y\n0,1,2\n1,2," + "a" * 140_000 + "\n"])
def test_a_cell_without_an_end_is_refused_by_its_line(tmp_path: Path, text: str) -> None:
    """The csv module reads cells up to a length."""
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match=r"run\.csv, line \d: a cell of more than"):
        read_record(tmp_path / "run.csv", MODEL)


def test_a_small_parquet_file_that_holds_much_is_refused(tmp_path: Path) -> None:
    """Kilobytes that would be gigabytes."""
    column = pa.array(np.zeros(40_000_000, np.int8))
    pq.write_table(pa.table({"t": column, "u": column, "y": column}), tmp_path / "run.parquet", compression="zstd")
    assert (tmp_path / "run.parquet").stat().st_size < 1_000_000
    with pytest.raises(InputError, match="split it"):
        read_record(tmp_path / "run.parquet", MODEL)


@pytest.mark.parametrize("kind", ["list", "bytes"])
def test_a_parquet_column_that_is_no_number_is_refused(tmp_path: Path, kind: str) -> None:
    """By its type, before it is read."""
    column = {"list": [[1], [2]], "bytes": [b"1", b"2"]}[kind]
    pq.write_table(pa.table({"t": [0, 1], "u": [1, 2], "y": column}), tmp_path / "run.parquet")
    with pytest.raises(InputError, match="expected numbers"):
        read_record(tmp_path / "run.parquet", MODEL)


def test_a_plan_or_grid_of_too_many_cells_is_refused(tmp_path: Path) -> None:
    """Before the cells are made."""
    table = {"cases": ["null-oscillator"], "estimators": ["ekf"], "seeds": 10**12}
    with pytest.raises(InputError, match="fewer seeds"):
        plan.parse(table, "mine", "mine").cells()
    with pytest.raises(InputError, match="fewer values"):
        grids.variants({name: [1.0] * 30 for name in "abcd"})


@pytest.mark.parametrize("row", ["[]", "1", "{", "\0", b"\xff", None])
def test_a_damaged_row_of_a_store_is_refused(tmp_path: Path, row: str | bytes | None) -> None:
    """Where it is read, with the file's name."""
    with Store(tmp_path / "s.sqlite") as store:
        store.put(Cell("a", 0.1, "b", "c", 0), "k", {})
        if row is None:
            store.execute("UPDATE cells SET \"case\" = CAST(x'ff' AS TEXT)")
        else:
            store.execute("UPDATE cells SET row = ?", (row,))
        with pytest.raises(InputError, match=r"s\.sqlite"):
            store.rows()


@pytest.mark.parametrize("target", ["expression", "model", "csv_file", "parquet_file", "store"])
def test_whatever_comes_the_readers_keep_their_bounds(tmp_path: Path, target: str) -> None:
    """A short run of the fuzzing, from a fixed seed."""
    report = tmp_path / "report.json"
    command = [sys.executable, str(FUZZ), "--target", target, "--examples", "60", "--seconds", "20", "--seed", "7"]
    ended = subprocess.run([*command, "--json", str(report)], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stdout
    assert json.loads(report.read_text())[0]["tried"] >= 60
