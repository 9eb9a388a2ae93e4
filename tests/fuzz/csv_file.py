"""Tables as text: what programs, spreadsheets and accidents write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hypothesis import strategies as st
from mutations import NASTY_NUMBERS, bytewise, textwise, words
from oracle import Oracle

from suite.model import Input, Model, Output
from suite.readers import read_record

MODEL = Model("plant", {"x": "-x + u"}, inputs={"u": Input("u", "linear")}, outputs={"y": Output("x", "y")})
GOOD = "t,u,y\n0,1,2\n1,2,3\n2,,4\n3,1,\n"
SEEDS = (
    GOOD,
    GOOD.replace(",", ";").replace("2\n", "2,5\n"),
    GOOD.replace(",", "\t"),
    "# rig\n" + GOOD,
    '"t","u","y"\n0,1,2\n1,2,3\n',
)
PIECES = (
    ",",
    ";",
    "\t",
    '"',
    "''",
    "#",
    "\r",
    "\n",
    "NaN",
    "NA",
    "2024-01-01 12:00:00",
    "12:00",
    "1,5",
    " ",
    "t",
    "y",
    "y,y",
)
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1", "cp1252", "utf-7", "cp037")
names = st.one_of(st.sampled_from(["t", "u", "y", "y.1", "time", "T", "", "1", "nan", "Unnamed: 0"]), words)
cells = st.one_of(
    st.floats().map(repr), st.integers(-99, 99).map(str), st.sampled_from(NASTY_NUMBERS), st.sampled_from(PIECES), words
)


@st.composite
def tables(draw: st.DrawFn) -> str:
    """Rows of any cells under any names, with times that mostly rise."""
    mark, end = (
        draw(st.sampled_from(",;\t| ")),
        draw(st.sampled_from(["\n", "\r\n", "\r", "\n\n", "\n\r", ",\n", ";\n"])),
    )
    header = draw(st.one_of(st.just(["t", "u", "y"]), st.lists(names, max_size=6)))
    sound = st.tuples(st.just("1.5"), st.sampled_from(["2", "", "0.5"])).map(list)
    row = st.one_of(sound, st.lists(cells, max_size=7))
    rows = [[str(k), *draw(row)] for k in range(draw(st.integers(0, 8)))]
    return end.join(mark.join(line) for line in [header, *rows]) + draw(st.sampled_from(["", end, end * 3]))


@st.composite
def files(draw: st.DrawFn) -> bytes:
    match draw(st.sampled_from(["table", "table", "text", "bytes", "long", "noise"])):
        case "table":
            return draw(tables()).encode(draw(st.sampled_from(ENCODINGS)), "replace")
        case "text":
            return draw(textwise(draw(st.sampled_from(SEEDS)), PIECES)).encode("utf-8", "surrogatepass")
        case "bytes":
            return draw(bytewise(draw(st.sampled_from(SEEDS)).encode(draw(st.sampled_from(ENCODINGS)))))
        case "long":
            # One line, one cell, one name, or as many columns, of up to a million characters.
            unit = draw(
                st.sampled_from(
                    ["a", ",", "1,", "\n", '"', "#", "1;2;", "\t", "é", "1", "a\n", '"\n', "\r", " ", "0,1,2\n"]
                )
            )
            before = draw(st.sampled_from(["", "t,u,y\n", "t,u,y\n0,1,2\n1,2,", 't,u,y\n0,1,"', "# "]))
            return (before + unit * (draw(st.sampled_from([999, 65_536, 140_000, 1_000_000])) // len(unit))).encode()
        case _:
            return draw(st.binary(max_size=300))


strategy = st.tuples(files(), st.sampled_from(["run.csv", "run.csv", "run.tsv", "run.txt", "run.dat"]))


def prepare(oracle: Oracle, folder: Path) -> Any:
    """The file as a record of a model."""
    return lambda given: read(oracle, folder / given[1], given[0])


def read(oracle: Oracle, path: Path, given: bytes) -> None:
    """What was drawn, written to a file and read as a record of a model."""
    path.write_bytes(given)
    oracle.check(lambda: read_record(path, MODEL), f"{path.name}: {given!r}", path)
