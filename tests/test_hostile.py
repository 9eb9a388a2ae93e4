"""Hostile and broken input ends in one sentence, soon, in little memory, and touches nothing else."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from suite import columns, mat_file, plugins
from suite.benchmark import grids, plan
from suite.benchmark.cells import Cell
from suite.benchmark.store import Store
from suite.errors import LONGEST, InputError
from suite.model import Input, Model, Output
from suite.model_file import from_toml
from suite.readers import read_record
from suite.sample_lines import lines_of

MODEL = Model("plant", {"x": "-x + u"}, inputs={"u": Input("u")}, outputs={"y": Output("x", "y")})
FUZZ = Path(__file__).with_name("fuzz")


def test_a_sentence_is_one_line_however_long_or_odd_what_it_quotes() -> None:
    """Control characters are shown as codes; the mend at the end stays."""
    said = str(InputError("a" * 5000 + "\x1b[31m\n; mend that"))
    assert len(said) <= LONGEST
    assert said.isprintable()
    assert said.endswith("; mend that")


def test_the_longest_list_of_names_is_whole() -> None:
    """What there is to choose from is not cut."""
    with pytest.raises(InputError) as refusal:
        plan.parse({"cases": ["nothing"], "estimators": ["ekf"]}, "mine", "mine").cells()
    assert str(refusal.value).endswith(", ".join(plugins.cases()))


@pytest.mark.parametrize(
    "text",
    [
        "[states]\n" + "".join(f'x{k}="-x{k}"\n' for k in range(1001)),
        "[states]\n" + "".join(f'x{k}="x{k}{"+1.0*x0" * 1000}"\n' for k in range(5)),
        "# " + "x" * 100_000,
    ],
    ids=["entries", "letters", "bytes"],
)
def test_a_model_that_would_take_long_is_refused(text: str) -> None:
    """By its size, before an equation is read."""
    with pytest.raises(InputError, match=r"at most \d+ are read|too large for a model file"):
        from_toml(text)


def test_a_key_of_very_many_parts_is_refused() -> None:
    """Reading it takes time with the square of its parts."""
    with pytest.raises(InputError, match=r"more than 100 parts \(at line 2\)"):
        from_toml("\n" + "a." * 45_000 + "b = 1")


@pytest.mark.parametrize("text", ["a" * 140_000 + ",u,y\n1,2,3\n", "t,u,y\n0,1,2\n1,2," + "a" * 140_000 + "\n"])
def test_a_cell_without_an_end_is_refused_by_its_line(tmp_path: Path, text: str) -> None:
    """The csv module reads cells up to a length."""
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match=r"run\.csv, line \d: a cell of more than"):
        read_record(tmp_path / "run.csv", MODEL)


@pytest.mark.parametrize("name", ["run.csv", "run.txt"])
def test_a_line_of_200_mb_is_refused_where_it_does_not_end(tmp_path: Path, name: str) -> None:
    """Of the file a piece is held, however long the line is."""
    with (tmp_path / name).open("wb") as out:
        out.write(b"t,u,y\n0,1,2\n")
        for _ in range(200):
            out.write(b"1,2,3,4," * 125_000)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"line \d: longer than 1 MB"):
            read_record(tmp_path / name, MODEL)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(("size", "sentence"), [(1 << 30, "not a text file"), ((1 << 30) + 1, "larger than 1 GB")])
def test_a_gigabyte_of_nothing_is_refused_unread(tmp_path: Path, size: int, sentence: str) -> None:
    """A file with a hole says that it is large, and holds NULs."""
    with (tmp_path / "run.csv").open("wb") as out:
        out.truncate(size)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=sentence):
            read_record(tmp_path / "run.csv", MODEL)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


def test_a_stream_whose_line_does_not_end_is_refused() -> None:
    """What is watched may come for ever."""
    with pytest.raises(InputError, match="line 2: longer than"):
        list(lines_of(io.StringIO("t,u,y\n" + "1," * 2_000_000), "stream"))


@pytest.mark.parametrize("text", ["a,b,c,d,e,f,g,h" * 2000 + "\n1,2\n", "t,u,y\n0,1,2" + "," * 20_000 + "\n"])
def test_a_table_of_more_columns_than_anyone_measures_is_refused(tmp_path: Path, text: str) -> None:
    """Whether its names or its rows are wide."""
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match="columns, at most 10000 are read"):
        read_record(tmp_path / "run.csv", MODEL)


GOOD = "t,u,y\n0,1,2.5\n1,2,3\n"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252"])
def test_the_encodings_of_spreadsheets_say_the_same(tmp_path: Path, encoding: str) -> None:
    """With a byte order mark and without."""
    text = GOOD.replace("y\n", "y,\u00dcberdruck\n").replace("3\n", "3,\n")
    (tmp_path / "run.csv").write_bytes(text.encode(encoding))
    np.testing.assert_array_equal(read_record(tmp_path / "run.csv", MODEL).y[:, 0], [2.5, 3.0])


@pytest.mark.parametrize(
    "text",
    [
        "sep=;\nt;u;y\n0;1;2,5\n1;2;3\n",
        '"sep=;"\r\nt;u;y\r\n0;1;2,5\r\n1;2;3\r\n',
        "\ufeffSEP=,\nt,u,y\n0,1,2.5\n1,2,3\n",
        'sep=;\n"t";"u";"y";"a,b,c,d"\n0;1;2,5;\n1;2;3;\n',
        "sep=\t\nt\tu\ty\n0\t1\t2,5\n1\t2\t3\n",
    ],
)
def test_the_separator_that_a_spreadsheet_states_counts(tmp_path: Path, text: str) -> None:
    """Excel's first line is no header."""
    (tmp_path / "run.csv").write_bytes(text.encode())
    np.testing.assert_array_equal(read_record(tmp_path / "run.csv", MODEL).y[:, 0], [2.5, 3.0])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t,u,y\n2024-01-01 12:00:00,1,2\n2024-01-01 12:00:01,2,3\n", "line 2, column t.*convert dates to seconds"),
        ("t;u;y\n01.02.2024;1;2\n02.02.2024;2;3\n", "line 2, column t.*convert dates to seconds"),
        ("t,u,y\n12:00:00,1,2\n12:00:01,2,3\n", "line 2, column t.*convert dates to seconds"),
        ("t;u;y\n0;1;1.234,5\n1;2;3\n", "line 2, column y: expected a number, got '1.234,5'"),
        ('t,u,y\n0,1,"1,234.5"\n1,2,3\n', "line 2, column y: expected a number, got '1,234.5'"),
        ("t,u,y,t\n0,1,2,0\n1,2,3,1\n", "2 columns are called 't'"),
        ("t,u,y\n0,1,\0\n1,2,3\n", "not a text file"),
    ],
)
def test_what_programs_write_for_people_is_said_with_its_place(tmp_path: Path, text: str, sentence: str) -> None:
    """Dates as time, thousands, columns that are there twice, NULs."""
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match=sentence):
        read_record(tmp_path / "run.csv", MODEL)


@pytest.mark.parametrize("name", ["run.csv.gz", "run.zip", "run.csv.xz", "run.xlsx", "run.npz", "run.pkl"])
def test_archives_and_pickles_are_not_opened(tmp_path: Path, name: str) -> None:
    """So nothing in them is unpacked or run."""
    (tmp_path / name).write_bytes(b"\x80\x04")
    with pytest.raises(InputError, match="are not read; save it as CSV"):
        read_record(tmp_path / name, MODEL)


@pytest.mark.parametrize("stated", [8, 2_000_000_000])
def test_a_mat_variable_that_inflates_to_much_or_to_more_than_it_says_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stated: int
) -> None:
    """Its head is looked at first, then as much of it as it may hold is inflated piece by piece."""
    monkeypatch.setattr(mat_file, "LARGEST", 1_000_000)
    packed = zlib.compress(np.array([14, stated], np.uint32).tobytes() + bytes(10_000_000))
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + np.array([15, len(packed)], np.uint32).tobytes()
    (tmp_path / "run.mat").write_bytes(head + packed)
    with pytest.raises(InputError, match="inflates to more than"):
        read_record(tmp_path / "run.mat", MODEL)


def test_a_small_parquet_file_that_holds_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kilobytes that would be many times as much."""
    monkeypatch.setattr(columns, "MOST", 1_000_000)
    column = pa.array(np.zeros(400_000, np.int8))
    pq.write_table(pa.table({"t": column, "u": column, "y": column}), tmp_path / "run.parquet", compression="zstd")
    assert (tmp_path / "run.parquet").stat().st_size < 10_000
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


@pytest.mark.parametrize("target", ["model", "csv_file", "parquet_file", "mat_file"])
def test_whatever_comes_the_readers_keep_their_bounds(tmp_path: Path, target: str) -> None:
    """A short run of the fuzzing, from a fixed seed; that of model files has the equations in it."""
    report = tmp_path / "report.json"
    command = [sys.executable, str(FUZZ), "--target", target, "--examples", "60", "--seconds", "600", "--seed", "7"]
    ended = subprocess.run([*command, "--json", str(report)], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stdout
    assert json.loads(report.read_text())[0]["tried"] >= 60
