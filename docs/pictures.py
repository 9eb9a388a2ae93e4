"""The pictures and tables of the documentation, made again: `tox run -e pictures`.

    python docs/pictures.py [--data DIR] [--only NAME ...] [--tables]

`--tables` writes the tables of the gallery and of the limits alone, which takes seconds. `--data` names the folder of
the measured records that are not shipped; a case whose record is not there keeps its picture.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import re
import sys
import tempfile
from pathlib import Path

import nbformat
from matplotlib.figure import Figure
from nbclient import NotebookClient

from suite import plugins
from suite.__main__ import main as unmodelled
from suite.benchmark.table import markdown
from suite.errors import DataError
from suite.files import write_whole
from suite.report import gallery
from suite.report.canvas import BLUE, GREEN, INK, SKY, VERMILION, dressed, new_figure
from suite.report.vector import svg

DOCS = Path(__file__).parent
PICTURES = DOCS / "pictures"
GALLERY = DOCS / "gallery.md"
NOTEBOOK = DOCS / "notebook.ipynb"
LIMITS = DOCS / "limits.md"
MATRIX = DOCS / "matrix.md"
RESULTS = DOCS.parent / "results"
MEASURED = RESULTS / "measured" / "measured.json"
FULL = RESULTS / "full"
SHOWN = 20  # methods of the matrix in its table
DEMANDS = RESULTS / "recovery" / "must-reach.csv"
# The held-out part that is drawn, where a case has several.
CASES = {
    "cooling-mug": "last 30 %", "indometacin": "subject 6", "cefamandole": "subject 6", "whiffle-ball": "last run",
    "rocket-camoes": "last 40 %", "rocket-erebus": "last 40 %", "cascaded-tanks": "validation", "silverbox": "arrow",
    "emps": "pulses",
}  # fmt: skip
BLOCK = re.compile(r"(<!-- (measured|recovery|matrix): (\S+) -->\n).*?(<!-- end -->)", re.DOTALL)


def with_tables(page: str) -> str:
    """A page with what stands between its marks as the stored results have it: the table of a measured case, the
    demands of the recovery benchmark, or what the full matrix says.
    """
    made = {"demands": demands, "verdict": sentences, "methods": methods}
    rows = gallery.stored(MEASURED)

    def filled(found: re.Match[str]) -> str:
        own = [row for row in rows if row["case"] == found[3]]
        text = gallery.table(own) if found[2] == "measured" else made[found[3]]()
        return f"{found[1]}\n{text}\n\n{found[4]}"

    return BLOCK.sub(filled, page)


def demands() -> str:
    """The demands on the recovery benchmark with the figures reached, as a Markdown table."""
    with DEMANDS.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    cells = [["what", "figure", "95 % interval", "of", "wanted", "met"]]
    # What no record asked for has no figure.
    for row in (row for row in rows if row["figure"]):
        figure, low, high = (f"{float(row[key]):.3g}" for key in ("figure", "low", "high"))
        what = row["what"].strip() if row["what"] == row["what"].lstrip() else f"– {row['what'].strip()}"
        met = "yes" if row["reached"] == "True" else "**no**"
        cells.append([what, figure, f"{low} to {high}", row["count"], row["target"], met])
    return markdown(cells)


def sentences() -> str:
    """The verdict of the full matrix, as a list."""
    said = (FULL / "verdict.txt").read_text(encoding="utf-8").split("\n\n")
    return "\n".join(f"- {sentence.strip()}" for sentence in said)


def methods() -> str:
    """The first methods of the full matrix by mean rank, tuned, as a Markdown table."""
    with (FULL / "tables" / "methods.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["mean_rank"] and row["variant"] == "tuned"]
    cells = [["method", "kind", "state error over the EKF's", "95 %", "error of d", "NEES", "µs a step", "failed"]]
    for row in rows[:SHOWN]:
        ratio, low, high, d = (f"{float(row[key]):.2f}" for key in ("ratio", "ratio_low", "ratio_high", "d_nrmse"))
        nees = f"{float(row['nees']):.2f}" if row["nees"] else "–"
        failed = f"{row['failed']} of {row['ran']}"
        name = f"`{row['estimator']}`"
        cells.append([name, row["kind"], ratio, f"{low} to {high}", d, nees, f"{float(row['step_us']):.0f}", failed])
    return markdown(cells)


def tables() -> None:
    """Write the tables of the gallery, of the limits and of the matrix."""
    for page in (GALLERY, LIMITS, MATRIX):
        write_whole(page, with_tables(page.read_text(encoding="utf-8")))


def cases(names: list[str], folder: Path | None) -> None:
    """Write the picture of each measured case."""
    effects, rows = plugins.effects(), gallery.stored(MEASURED)
    for name, part in CASES.items():
        if names and name not in names:
            continue
        row = next(row for row in rows if row["case"] == name and row["part"] == part)
        print(f"{name} ...", file=sys.stderr, flush=True)
        try:
            drawn = gallery.picture(plugins.cases()[name], row, folder, effects)
        except DataError as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        write_whole(PICTURES / f"{name}.svg", svg(drawn, name) + "\n")


def mug() -> None:
    """The tutorial's figures and the error step by step, from the commands themselves."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        model, data, cubic, found = (root / name for name in ("model.toml", "data.csv", "cubic.toml", "found"))
        _run("example", "mug", root)
        given = _error("compare", model, data)
        refitted = _error("compare", model, data, "--refit")
        _run("add", model, "cubic_term", "--data", data, "-o", cubic)
        one = _error("compare", cubic, data)
        _run("discover", model, data, "-o", found)
        ledger = json.loads((found / "ledger.json").read_text(encoding="utf-8"))
        for name in ("compare", "discrepancy", "candidates"):
            drawn = (found / "figures" / f"step0-{name}.svg").read_text(encoding="utf-8")
            write_whole(PICTURES / f"mug-{name}.svg", drawn + "\n")
    after = ledger["steps"][-1]["error"]["T"]
    write_whole(PICTURES / "mug-steps.svg", svg(_steps(given, refitted, one, after), "steps") + "\n")


def _steps(given: float, refitted: float, one: float, after: float) -> Figure:
    said = f"A mug of cooling water: the error falls from {given:.2f} °C to {after:.2f} °C"
    fig = new_figure(said, said + "; step by step: as given, refitted, with a cubic loss, with the mug's own heat", 3.6)
    ax = fig.subplots()
    heights = [given, refitted, one, after]
    names = [
        "Newton's law,\nas given",
        "Newton's law,\nrefitted",
        "+ a loss that grows\nwith the cube",
        "+ a second\nthermal mass",
    ]
    ax.bar(range(4), heights, width=0.6, color=[VERMILION, SKY, BLUE, GREEN])
    for k, value in enumerate(heights):
        ax.annotate(f"{value:.3g} °C", (k, value), (0, 3), textcoords="offset points", ha="center", fontsize=11)
    ax.axhline(0.05, color=INK, linestyle="--", linewidth=1.2)
    ax.annotate("noise of\nthe probe", (3.36, 0.05), (0, 3), textcoords="offset points", fontsize=9.5)
    ax.set_yscale("log")
    ax.set_ylim(0.02, 4.0)
    ax.set_yticks([0.03, 0.1, 0.3, 1, 3], ["0.03", "0.1", "0.3", "1", "3"])
    ax.set_xticks(range(4), names)
    ax.set_xlim(-0.5, 3.95)
    dressed(ax, "", "RMSE in °C, logarithmic")
    ax.minorticks_off()
    ax.grid(False, axis="x")
    return fig


def paper() -> None:
    """The figures of the idea, from the published plant with 5 % noise."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        _run("example", "paper", root)
        _run("discover", root / "model.toml", root / "data.csv", "-o", root / "found")
        for name in ("step0-compare", "step0-discrepancy", "step0-candidates", "step0-map", "waterfall"):
            drawn = (root / "found" / "figures" / f"{name}.svg").read_text(encoding="utf-8")
            write_whole(PICTURES / f"paper-{name.removeprefix('step0-')}.svg", drawn + "\n")


def notebook() -> None:
    """Run the notebook from a clean kernel and store its outputs, without the text beside a display."""
    book = nbformat.read(NOTEBOOK, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(book, kernel_name="python3", record_timing=False).execute(cwd=folder)
    for cell in book.cells:
        for output in cell.get("outputs", []):
            if len(output.get("data", {})) > 1:
                output["data"].pop("text/plain", None)
    nbformat.write(book, NOTEBOOK)


def _error(*arguments: object) -> float:
    return float(json.loads(_run(*arguments, "--json"))["error"]["T"])


def _run(*arguments: object) -> str:
    """What a command prints; an exception where it ends in anything but 0."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = unmodelled([str(argument) for argument in arguments])
    if code != 0:
        raise RuntimeError(f"unmodelled {' '.join(map(str, arguments))}: exit code {code}")
    return said.getvalue()


def main() -> None:
    """Make what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of measured records that are not shipped")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="mug, paper, notebook, or a measured case"
    )
    parser.add_argument("--tables", action="store_true", help="the tables alone")
    args = parser.parse_args()
    PICTURES.mkdir(exist_ok=True)
    tables()
    if args.tables:
        return
    for name, make in (("mug", mug), ("paper", paper), ("notebook", notebook)):
        if not args.only or name in args.only:
            make()
    cases(args.only, args.data)


if __name__ == "__main__":
    main()
