"""Measured files become records; what is wrong with a file is said with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from suite.errors import DataError
from suite.model import Input, Model, Output
from suite.readers import read_record, read_table, write_csv

MODEL = Model("plant", {"x": "-x + u"}, inputs={"u": Input("u")}, outputs={"y": Output("x", "y")})
LINE = Model("plant", {"x": "-x + u"}, inputs={"u": Input("u", "linear")}, outputs={"y": Output("x", "y")})
GOOD = "t,u,y\n0,1,2\n1,2,3\n"
DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def _file(folder: Path, text: str, name: str = "run.csv", encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        '"t","u","y",\n0,1,2,\n1,2,3,\n',
        "t;u;y\n0;1,0;2,0\n1;2;3\n",
        "t;u;y\n0;1.0;2\n1;2;3\n",
        "t\tu\ty\n0\t1\t2\n1\t2\t3\n",
        "t, u, y\r\n0, 1, 2\r\n1, 2, 3\r\n",
        "\ufefft,u,y\n0,1,2\n1,2,3\n",
        "# rig 4\n# t,u,y\n0,1,2\n1,2,3\n",
        "# rig 4\nt,u,y\n0,1,2\n1,2,3\n",
        "\n\nt,u,y\n\n0,1,2\n\n1,2,3\n,,\n,,\n",
        't,u,y,note\n0,1,2,"a, b"\n1,2,3,\n',
        "y,Ts,u,t\n2,4,1,0\n3,,2,1\n",
        "t,u,y\n0,1,2\n1,2,3",
    ],
)
def test_the_dialects_of_real_files_say_the_same(tmp_path: Path, text: str) -> None:
    """Quotes, trailing separators, semicolons, decimal commas, comments, blank lines, columns in any order."""
    record = read_record(_file(tmp_path, text), MODEL)
    np.testing.assert_array_equal(record.t, [0.0, 1.0])
    np.testing.assert_array_equal(record.u, [[1.0], [2.0]])
    np.testing.assert_array_equal(record.y, [[2.0], [3.0]])
    assert record.names == ("run.csv",)


def test_encodings_of_spreadsheets_are_read(tmp_path: Path) -> None:
    """UTF-16 and Latin-1 exports need no conversion."""
    for encoding in ("utf-16", "latin-1"):
        text = GOOD.replace("t,u,y", "t,u,y,Überdruck").replace("2\n", "2,\n")
        assert len(read_record(_file(tmp_path, text, encoding=encoding), MODEL)) == 2


def test_empty_outputs_are_missing_and_empty_inputs_follow_their_hold(tmp_path: Path) -> None:
    """NaN in y; the value before, or a line across, in u."""
    path = _file(tmp_path, "t,u,y\n0,1,\n1,,2\n3,,NaN\n4,5,3\n5,,\n")
    record = read_record(path, MODEL)
    np.testing.assert_array_equal(record.y[:, 0], [np.nan, 2.0, np.nan, 3.0, np.nan])
    np.testing.assert_array_equal(record.u[:, 0], [1.0, 1.0, 1.0, 5.0, 5.0])
    np.testing.assert_allclose(read_record(path, LINE).u[:, 0], [1.0, 2.0, 4.0, 5.0, 5.0])


def test_several_files_are_several_runs(tmp_path: Path) -> None:
    """Each with its own start and its own name; time may begin anew."""
    record = read_record([_file(tmp_path, GOOD, "a.csv"), _file(tmp_path, GOOD, "b.csv")], MODEL)
    assert record.starts == (0, 2)
    assert [run.names for run in record.runs] == [("a.csv",), ("b.csv",)]
    assert [run.source for run in record.runs] == ["a.csv", "b.csv"]


def test_the_time_column_is_the_named_one_or_t_or_the_first(tmp_path: Path) -> None:
    """`time` of the model wins."""
    path = _file(tmp_path, "clock,t,u,y\n10,0,1,2\n20,1,2,3\n")
    timed = Model("m", {"x": "-x + u"}, inputs={"u": Input("u")}, outputs={"y": Output("x", "y")}, time="clock")
    assert read_record(path, timed).t[1] == 20.0
    assert read_record(path, MODEL).t[1] == 1.0
    assert read_record(_file(tmp_path, "clock,u,y\n10,1,2\n20,2,3\n"), MODEL).t[1] == 20.0


DEFECTS = {
    "text": ("t,u,y\n0,1,2\n\n1,2,off\n", "run.csv, line 4, column y: expected a number, got 'off'"),
    "date": ("t,u,y\n2020-01-01,1,2\n1,2,3\n", "line 2, column t: expected a number, got '2020-01-01'"),
    "underscore": ("t,u,y\n0,1,2\n1,2,1_0\n", "line 3, column y: expected a number, got '1_0'"),
    "long text": (f"t,u,y\n0,1,2\n1,2,{'z' * 999}\n", "z..."),
    "missing column": ("t,u,Y1\n0,1,2\n1,2,3\n", "no column 'y' (it has t, u, Y1)"),
    "close column": ("t,u,Y\n0,1,2\n1,2,3\n", "did you mean 'Y'"),
    "repeated time": ("t,u,y\n0,1,2\n1,1,2\n1,2,3\n", "line 4, column t: time repeats (1.0 after 1.0)"),
    "decreasing time": ("t,u,y\n0,1,2\n1,1,2\n\n0.5,2,3\n", "line 5, column t: time runs backwards (0.5 after 1.0)"),
    "no time": ("t,u,y\n0,1,2\n,2,3\n", "line 3, column t: no time"),
    "time is the input": ("u,y\n0,1\n1,2\n", "no time column (the first column 'u' is u); add a column t"),
    "one row": ("t,u,y\n0,1,2\n", "1 row(s), at least 2 are needed"),
    "no rows": ("t,u,y\n", "column names and no rows"),
    "empty": ("", "the file is empty"),
    "blank": ("\n \n", "no rows"),
    "no header": ("0,1,2\n1,2,3\n", "line 1: numbers where the column names should be"),
    "duplicates": ("t,u,y,y\n0,1,2,3\n1,2,3,4\n", "2 columns are called 'y'"),
    "output never measured": ("t,u,y\n0,1,\n1,2,\n", "column y: no value at all for the output y"),
    "input empty at first": ("t,u,y\n0,,2\n1,2,3\n", "line 2, column u: the input is empty at the start"),
    "infinite": ("t,u,y\n0,1,2\n1,2,inf\n", "line 3, column y: an infinite value"),
    "decimal commas": ("t,u,y\n0,1,5,2,5\n1,2,5,3,5\n", "line 2: 5 cells under 3 column names; decimal commas"),
    "surplus cell": ("t,u,y\n0,1,2\n1,2,3,4\n", "line 3: 4 cells under 3 column names"),
    "binary": ("t,u,y\n\0\0\0\n", "not a text file"),
    "open quote": ('t,u,y\n0,1,2\n1,2,"3\n2,3,4\n', "expected a number"),
}


@pytest.mark.parametrize(("text", "sentence"), DEFECTS.values(), ids=DEFECTS.keys())
def test_every_defect_is_one_sentence_with_its_line_and_mend(tmp_path: Path, text: str, sentence: str) -> None:
    """File, line, column, what came, what to do."""
    with pytest.raises(DataError) as refusal:
        read_record(_file(tmp_path, text), MODEL)
    said = str(refusal.value)
    assert sentence in said
    assert said.startswith("run.csv")
    assert ";" in said
    assert "\n" not in said
    assert len(said) < 300


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """Missing, a folder, a spreadsheet, a damaged parquet or MAT file, and no file at all."""
    _file(tmp_path, "PK", "run.xlsx")
    _file(tmp_path, "no parquet", "run.parquet")
    _file(tmp_path, "no mat file, but long enough to be looked at" * 10, "run.mat")
    for name, sentence in {
        "absent.csv": "no such file",
        "": "is a folder",
        "run.xlsx": "files .xlsx are not read; save it as CSV",
        "run.parquet": "not a parquet file",
        "run.mat": "not a MAT file",
    }.items():
        with pytest.raises(DataError, match=sentence):
            read_record(tmp_path / name, MODEL)
    with pytest.raises(DataError, match="no data files"):
        read_record([], MODEL)


def test_parquet_and_mat_files_hold_the_same_record(tmp_path: Path) -> None:
    """The kind of file makes no difference; constants beside MATLAB's vectors do not disturb."""
    columns = {"t": np.array([0.0, 0.5, 2.0]), "u": np.array([1.0, 2.0, 3.0]), "y": np.array([2.0, np.nan, 4.0])}
    write_csv(tmp_path / "a.csv", columns)
    pd.DataFrame(columns).to_parquet(tmp_path / "a.parquet")
    scipy.io.savemat(tmp_path / "a.mat", {**columns, "k": 3.0, "A": np.eye(3), "note": "rig 4"})
    first, *others = (read_record(tmp_path / f"a.{suffix}", MODEL) for suffix in ("csv", "parquet", "mat"))
    for other in others:
        np.testing.assert_array_equal(other.t, first.t)
        np.testing.assert_array_equal(other.u, first.u)
        np.testing.assert_array_equal(other.y, first.y)


def test_mat_files_of_version_7_3_are_refused_with_the_way_out(tmp_path: Path) -> None:
    """They are HDF5 inside; saving with -v7 is the mend."""
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    (tmp_path / "run.mat").write_bytes(head + bytes(512))
    with pytest.raises(DataError, match=r"version 7\.3 is not read; save it with"):
        read_record(tmp_path / "run.mat", MODEL)


def test_mat_vectors_of_unequal_length_are_refused(tmp_path: Path) -> None:
    """Their lengths are named."""
    scipy.io.savemat(tmp_path / "run.mat", {"t": np.arange(3.0), "u": np.arange(3.0), "y": np.arange(4.0)})
    with pytest.raises(DataError, match=r"differ in length \(t 3, u 3, y 4\)"):
        read_record(tmp_path / "run.mat", MODEL)


def test_what_is_written_is_read_back_to_the_last_digit(tmp_path: Path) -> None:
    """write_csv keeps every bit, NaN as an empty cell, odd names in quotes."""
    rng = np.random.default_rng(1)
    columns = {"t": np.cumsum(rng.random(200)), "a, b": rng.normal(size=200) * 10.0 ** rng.integers(-300, 300, 200)}
    columns["a, b"][3] = np.nan
    write_csv(tmp_path / "deep" / "out.csv", columns)
    again = read_table(tmp_path / "deep" / "out.csv").read(["t", "a, b"])
    for name, column in columns.items():
        np.testing.assert_array_equal(again[name], column)
    with pytest.raises(DataError, match="columns of one length"):
        write_csv(tmp_path / "out.csv", {"t": np.arange(3), "y": np.arange(4)})


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured records are not beside the project")
def test_measured_records_are_read_as_they_are() -> None:
    """Trailing commas, a constant in the first row only, MATLAB's columns, time in the second column."""
    tanks = Model("tanks", {"x": "-x + u"}, inputs={"u": Input("uEst")}, outputs={"y": Output("x", "yEst")})
    with pytest.raises(DataError, match="no time column"):
        read_record(DATA / "cascaded_tanks" / "dataBenchmark.csv", tanks)
    columns = read_table(DATA / "cascaded_tanks" / "dataBenchmark.csv").read(["uEst", "yEst", "Ts"])
    assert columns["yEst"].shape == (1024,)
    assert np.isnan(columns["Ts"]).sum() == 1023
    emps = Model("emps", {"x": "u"}, inputs={"u": Input("vir")}, outputs={"y": Output("x", "qm")})
    assert len(read_record(DATA / "emps" / "DATA_EMPS.mat", emps)) == 24_841
    rocket = Model("rocket", {"h": "0"}, outputs={"h": Output("h", "alt")})
    assert read_record(DATA / "rockets" / "erebus11_flight_data_filtered.csv", rocket).t[1] == 0.05
    box = read_table(DATA / "silverbox" / "SNLS80mV.csv")
    assert box.columns == ("V1", "V2")
    assert len(box.read(["V2"])["V2"]) == 131_072
