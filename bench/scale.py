"""What size costs, each run in a process of its own: `python bench/scale.py -o results/scale.json docs/scale.md`.

Lengths: a driven spring whose hardening the model lacks, with 10^4 to 10^7 samples as CSV and as parquet. States: a
chain of masses whose wall spring hardens, with 2 to 100 states; its candidates grow with it. Files after -o are pages
that get the table between two marks.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cases.chain_small import chain
from suite import __version__, plugins
from suite.case import Case, Experiment, Missing
from suite.discovery.fit import prepare
from suite.discovery.frame import Point
from suite.discovery.library import candidates
from suite.discovery.misfit import frozen
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter
from suite.model_file import write_model
from suite.record import Record
from suite.tables import write_csv

Array = npt.NDArray[np.float64]

LENGTHS = (10_000, 100_000, 1_000_000, 10_000_000)
MASSES = (1, 2, 4, 6, 12, 25, 50)
STEP, NOISE, CHUNK = 0.02, 0.02, 100_000
MARKS = ("<!-- scale -->", "<!-- /scale -->")
SPRING = Model(
    "oscillator",
    {"p": "v", "v": "u - c*v - k*p"},
    parameters={"c": Parameter(0.4, sd=0.1), "k": Parameter(2.2, sd=0.5)},
    inputs={"u": Input("u", "linear")},
    outputs={"pos": Output("p", "pos", sigma=NOISE)},
    initial={"p": Initial(0.0, estimate=True), "v": Initial(0.0, estimate=True)},
)


def driven(samples: int) -> dict[str, Array]:
    """The spring with what the model lacks, driven by filtered noise: time, force and measured position, (N,) each."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(1)
    fade = np.exp(-STEP / 0.5)
    u: Array = lfilter([3.0 * np.sqrt(1.0 - fade**2)], [1.0, -fade], rng.standard_normal(samples))
    t = np.asarray(np.arange(samples) * STEP, dtype=np.float64)
    truth = SPRING.with_values({"k": 2.0}).plus("v", "-a*p**3", {"a": Parameter(0.5)})
    y = np.zeros((samples, 1))
    point = Point(np.zeros((1, 2)), truth.values)
    problem = prepare(frozen(truth), Record(t[:500], u[:500, None], rng.standard_normal((500, 1))))
    layout = problem.layout(())
    for at in range(0, samples - 1, CHUNK):
        part = slice(at, min(at + CHUNK + 1, samples))
        passed = problem.on(Record(t[part], u[part, None], y[part]), point).run(point, 0.0, layout)
        y[part] = passed.Y
        point = Point(passed.X[-1:], truth.values)
    read = np.round(y[:, 0] + NOISE * rng.standard_normal(samples), 8)
    return {"t": t, "u": np.asarray(np.round(u, 8), dtype=np.float64), "pos": read}


def write(path: Path, columns: dict[str, Array]) -> None:
    """A table as CSV or parquet, by its suffix; of any length."""
    import pyarrow as pa
    from pyarrow import csv, parquet

    save = csv.write_csv if path.suffix == ".csv" else parquet.write_table
    save(pa.table(columns), path)


# A process that was forked counts its parent's memory as its own: ours is what the kernel says of it alone.
PROBE = """
import resource, sys
from pathlib import Path
from suite.__main__ import main

code = main(sys.argv[1:])
status = Path("/proc/self/status")
own = [line.split() for line in status.read_text().splitlines()] if status.exists() else []
peak = next((int(words[1]) for words in own if words[0] == "VmHWM:"), None)
most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(peak if peak is not None else most / (1024 if sys.platform == "darwin" else 1), file=sys.stderr)
sys.exit(code)
"""


def measured(verb: str, model: Path, data: Path) -> dict[str, Any]:
    """One command: processor and wall seconds, the largest memory, and what it said."""
    with tempfile.TemporaryFile() as out:
        began = time.monotonic()
        command = [sys.executable, "-c", PROBE, verb, str(model), str(data), "--json"]
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.PIPE)
        assert process.stderr is not None
        complaint = process.stderr.read().decode()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.monotonic() - began
        if process.returncode:
            raise SystemExit(f"{' '.join(command[3:])} failed: {complaint}")
        out.seek(0)
        said = json.loads(out.read())
    peak = float(complaint.split()[-1])
    cost = {"cpu_s": used.ru_utime + used.ru_stime, "wall_s": wall, "peak_mib": peak / 1024}
    if verb == "compare":
        return {**cost, "error": said["error"]}
    effects = [f"{e['effect']}@{e['equation']}" for e in said["effects"]]
    return {**cost, "verdict": said["verdict"], "effects": effects, "error": said["error"]["after"]}


def lengths(folder: Path, most: int) -> list[dict[str, Any]]:
    """The rows of the driven spring."""
    rows = []
    write_model(SPRING, folder / "spring.toml")
    for samples in (n for n in LENGTHS if n <= most):
        columns = driven(samples)
        for kind in ("csv", "parquet"):
            path = folder / f"spring.{kind}"
            write(path, columns)
            for verb in ("compare", "diagnose"):
                size = {"samples": samples, "kind": kind, "megabytes": path.stat().st_size / 1e6, "verb": verb}
                rows.append({**size, **measured(verb, folder / "spring.toml", path)})
                tell(rows[-1])
            path.unlink()
    return rows


def states(folder: Path, most: int) -> list[dict[str, Any]]:
    """The rows of the chain."""
    rows = []
    for masses in (n for n in MASSES if 2 * n <= most):
        model = chain(masses, tuple(sorted({1, (masses + 1) // 2, masses})))
        case = Case(
            name="chain",
            sentence="A chain of masses.",
            deficient=model,
            truth=model.plus("v1", "-a*x1**3", {"a": Parameter(8.0)}),
            experiment=Experiment(100.0, 0.1, (0.0,) * 2 * masses, {"F": multisine(6.0, 0.01, 0.4, 24)}),
            missing=(Missing("cubic_stiffness", "v1", {"a": 8.0}),),
        )
        record = case.simulate(0.01, 1)[0]
        write_model(model, folder / "chain.toml")
        columns = {"t": record.t, "force": record.u[:, 0]}
        columns |= {entry.column: record.y[:, j] for j, entry in enumerate(model.outputs.values())}
        write_csv(folder / "chain.csv", columns)
        tried = len(candidates(model, plugins.effects(), record=record))
        size = {"states": 2 * masses, "candidates": tried, "samples": len(record)}
        rows.append({**size, **measured("diagnose", folder / "chain.toml", folder / "chain.csv")})
        tell(rows[-1])
    return rows


def tell(row: dict[str, Any]) -> None:
    """A row as it comes, on standard error."""
    print(json.dumps(row), file=sys.stderr, flush=True)


def table(report: dict[str, Any]) -> str:
    """Both tables in Markdown, and where and when they were measured."""
    rows = ["| Samples | File | Command | Processor | Memory | Says |", "|---|---|---|---|---|---|"]
    for row in report["lengths"]:
        said = ", ".join(row["effects"]) if "effects" in row else f"error {row['error']['pos']:.3g}"
        rows.append(
            f"| {row['samples']:,} | {row['kind']}, {row['megabytes']:.3g} MB | {row['verb']} | {row['cpu_s']:.3g} s | "
            f"{row['peak_mib']:.0f} MiB | {said} |"
        )
    rows += [
        "",
        "| States | Candidates | Samples | Processor | Memory | Says |",
        "|---|---|---|---|---|---|",
    ]
    rows += [
        f"| {row['states']} | {row['candidates']} | {row['samples']} | {row['cpu_s']:.3g} s | "
        f"{row['peak_mib']:.0f} MiB | {', '.join(row['effects']) or row['verdict']} |"
        for row in report["states"]
    ]
    # Wall times stay in the report: where others have the processors too, they are theirs as well.
    return "\n".join([*rows, "", f"Measured on {report['machine']}; {report['versions']}; {report['date']}."])


def main() -> None:
    """Measure, write the report, and put the table into the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("pages", type=Path, nargs="*")
    parser.add_argument("--samples", type=int, default=LENGTHS[-1], help="of the longest record")
    parser.add_argument("--states", type=int, default=2 * MASSES[-1], help="of the longest chain")
    args = parser.parse_args()
    report: dict[str, Any] = {
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}",
        "versions": f"unmodelled {__version__}, Python {platform.python_version()}, numpy {np.__version__}",
        "date": datetime.date.today().isoformat(),
        "lengths": [],
        "states": [],
    }
    with tempfile.TemporaryDirectory() as folder:
        report["lengths"] = lengths(Path(folder), args.samples)
        report["states"] = states(Path(folder), args.states)
    args.output.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    for page in args.pages:
        before, _, rest = page.read_text(encoding="utf-8").partition(MARKS[0])
        page.write_text(
            f"{before}{MARKS[0]}\n{table(report)}\n{MARKS[1]}{rest.partition(MARKS[1])[2]}", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
