"""`unmodelled diagnose --each`: a verdict a file, one table, one report. Heavy imports wait until it runs."""

from __future__ import annotations

import argparse
import math
import re
import shlex
from pathlib import Path
from typing import Any

from suite.bench_verbs import count
from suite.errors import InputError

LIMIT = 120.0
STORE, TABLES, REPORT = "fleet.sqlite", ("fleet.parquet", "fleet.csv"), "report.html"
ELSEWHERE = "name another folder with -o"
# Machines and reasons that the terminal shows, and what it shows of a machine.
WORST, REASONS = 10, 3
SHOWN = ("file", "ratio", "verdict", "effects", "weight", "sentence")


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """The arguments that make `diagnose` judge a fleet."""
    fleet = verb.add_argument_group(
        "a fleet", "with --each; a DATA may then be a pattern in quotes, such as 'logs/*.csv'"
    )
    fleet.add_argument("--each", action="store_true", help="one verdict a file; else files are runs of one plant")
    fleet.add_argument("-o", "--output", type=Path, metavar="DIR", help="fleet.sqlite, .parquet, .csv and report.html")
    fleet.add_argument("--jobs", type=count, metavar="N", help="processes, default one a core")
    fleet.add_argument("--dask", metavar="ADDRESS", help="run on the Dask cluster whose scheduler is there")
    fleet.add_argument("--limit", type=seconds, metavar="SECONDS", help=f"time of one file at most, default {LIMIT:g}")
    fleet.add_argument("--memory", type=count, metavar="MIB", help="memory of one file at most, default 1024")
    fleet.add_argument("--force", action="store_true", help="run again what is stored and unchanged")


def seconds(text: str) -> float:
    """A time above zero; argparse calls a wrong one by this name."""
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: expected seconds above zero")
    return value


def asked(args: argparse.Namespace) -> bool:
    """Whether a fleet is asked for; InputError where an argument says so and --each does not, or one is missing."""
    given = [name for name in ("output", "jobs", "dask", "limit", "memory", "force") if getattr(args, name)]
    if args.each and args.output is None:
        raise InputError("--each needs a folder for its table and report: add -o DIR")
    if given and not args.each:
        option = "-o" if given[0] == "output" else f"--{given[0]}"
        raise InputError(f"{option} goes with --each, one verdict a file; add --each, or leave {option} out")
    return bool(args.each)


def run(args: argparse.Namespace) -> int:
    """Judge every file, then write the tables and the report of all that are asked for."""
    from suite.benchmark import table
    from suite.benchmark.driving import Driving
    from suite.benchmark.store import Store
    from suite.benchmark.worker import MEMORY
    from suite.files import writable_folder
    from suite.fleet import files, ranking, stored, tables
    from suite.fleet import run as fleet
    from suite.model_file import read_model
    from suite.report import fleet_page

    model = read_model(args.model)
    if not model.outputs:
        raise InputError(f"{args.model}: no outputs; add a table [outputs] that says what was measured")
    folder: Path = args.output
    chosen = files.chosen([str(path) for path in args.data], [folder / name for name in TABLES])
    writable_folder(folder)
    how = Driving(args.jobs, args.limit or LIMIT, args.memory or MEMORY, args.force, args.json, args.dask)
    parquet, text = (folder / name for name in TABLES)
    with Store(folder / STORE, elsewhere=ELSEWHERE) as store:
        done = fleet.run(chosen, fleet.Asked(model, args.model.name, args.absolute), store, how)
        briefs = ranking.ranked(done.briefs)
        tables.write(stored.rows(store, briefs), list(model.outputs), parquet, text)
        first = list(stored.rows(store, ranking.judged(briefs)[: fleet_page.SHOWN]))
    fleet_page.write(briefs, first, model, _command(args), folder / REPORT)
    told: dict[str, Any] = {"files": len(briefs), "run": done.run, "unchanged": done.unchanged}
    told |= ranking.summary(briefs)
    told["worst"] = [{"rank": k + 1, **{name: row[name] for name in SHOWN}} for k, row in enumerate(first[:WORST])]
    told["not_judged"] = ranking.failures(briefs)
    told["paths"] = [str(folder / name) for name in (STORE, *TABLES, REPORT)]
    if "ok" not in told["status"]:
        one = briefs[0]
        raise InputError(
            f"none of {len(briefs)} files could be judged; the first, {one.file}: {one.reason}; "
            f"all reasons are in {folder / REPORT}"
        )
    if args.json:
        print(table.to_json(told))
    else:
        _say(told)
    return 0


def _command(args: argparse.Namespace) -> str:
    """What makes the same again."""
    options = ["--absolute"] if args.absolute else []
    options += ["--limit", f"{args.limit:g}"] if args.limit else []
    options += ["--memory", str(args.memory)] if args.memory else []
    # A shell may have expanded the pattern into thousands of names.
    data = [str(path) for path in args.data]
    shown = " ".join(map(shlex.quote, data if len(data) <= WORST else data[:2]))
    more = f" ... ({len(data)} files)" if len(data) > WORST else ""
    start = f"unmodelled diagnose {shlex.quote(str(args.model))} {shown}{more} --each"
    return " ".join([start, *options, "-o", shlex.quote(str(args.output))])


def _say(told: dict[str, Any]) -> None:
    from suite.fleet.ranking import plain, ratio

    print(told["sentence"])
    status = ", ".join(f"{number} {name}" for name, number in sorted(told["status"].items()))
    print(f"{told['files']} files: {told['unchanged']} unchanged, {told['run']} run ({status})")
    if failing := [row for row in told["worst"] if row["verdict"] != "adequate"]:
        print("\nWorst, by error over noise:")
    for row in failing:
        what = plain(row["effects"]) or row["verdict"]
        sure = "" if row["verdict"] in ("missing_effect", "unexplained") else f" ({row['verdict']})"
        print(f"  {row['rank']:>4}  {ratio(row['ratio']):>8}  {row['file']}  {what}{sure}")
    if told["not_judged"]:
        print("\nNot judged:")
    for entry in told["not_judged"][:REASONS]:
        # A reason may be several lines, and most of them open with the file's name.
        reason = " ".join(entry["reason"].split())
        bare = re.sub(rf"^\S*{re.escape(Path(entry['file']).name)}", "", reason)
        like = "" if entry["count"] == 1 else f" (the first of {entry['count']} alike)"
        print(f"  {entry['file']}{like}{bare if bare != reason else f': {reason}'} ({entry['status']})")
    if (more := len(told["not_judged"]) - REASONS) > 0:
        print(f"  and {more} more kind{'' if more == 1 else 's'} of reason, in the report")
    print(f"\nReport: {told['paths'][-1]}\nTables: {', '.join(told['paths'][1:3])}")
