"""`unmodelled bench ...`: the verbs of the benchmark. Heavy imports wait until a verb runs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

STORE = Path("unmodelled-bench.sqlite")


def add_parser(subparsers: Any) -> None:
    """Add `bench` with its verbs to the command line."""
    parser = subparsers.add_parser("bench", help="run and show the matrix of estimators and cases")
    verbs = parser.add_subparsers(dest="bench", required=True, metavar="VERB")
    store = argparse.ArgumentParser(add_help=False)
    store.add_argument("--store", type=Path, default=STORE, metavar="FILE", help=f"results, default ./{STORE}")
    as_json = argparse.ArgumentParser(add_help=False)
    as_json.add_argument("--json", action="store_true", help="JSON alone on standard output")
    plan = argparse.ArgumentParser(add_help=False)
    plan.add_argument("--plan", default="spine", metavar="NAME|FILE", help="a plan of the package or a TOML file")
    plan.add_argument("--only", metavar="PATTERN", help="cells whose line in `bench list` holds this")
    plan.add_argument(
        "--estimators", nargs="+", metavar="NAME", help="instead of the plan's; a grid: 'ekf[q_scale=0.1,1,10]'"
    )
    plan.add_argument("--seeds", type=count, metavar="N", help="seeds instead of the plan's")
    plan.add_argument("--data", type=Path, metavar="DIR", help="folder of measured data that are not shipped")
    work = argparse.ArgumentParser(add_help=False)
    work.add_argument("--jobs", type=count, metavar="N", help="processes, default one a core")
    work.add_argument("--force", action="store_true", help="run again what is stored and unchanged")
    work.add_argument("--memory", type=count, metavar="MIB", help="memory of one cell at most, default the plan's")
    work.add_argument("--dask", metavar="ADDRESS", help="run on the Dask cluster whose scheduler is there")
    out = argparse.ArgumentParser(add_help=False)
    out.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="folder to write to")

    verbs.add_parser("list", parents=[plan, as_json], help="the plans, and the cells of one")
    runner = verbs.add_parser("run", parents=[plan, work, store, as_json], help="run the cells that are new or changed")
    runner.add_argument(
        "--collect", type=Path, nargs="+", metavar="FILE", help="merge other stores into this one and run nothing"
    )
    verbs.add_parser("tune", parents=[plan, work, store, as_json], help="only tune, with the same budget for all")
    table = verbs.add_parser("table", parents=[store, as_json], help="the results")
    table.add_argument("--rows", action="store_true", help="every cell instead of medians over seeds")
    table.add_argument(
        "--plan", metavar="NAME|FILE", help="the results of a plan; one of recovery has tables of its own"
    )
    table.add_argument("--only", metavar="TEXT", help="lines with this in case, estimator or variant")
    table.add_argument("-o", "--output", type=Path, metavar="FILE", help="write .csv, .parquet or .json")
    verbs.add_parser("plot", parents=[store, out, as_json], help="figures from the stored results, nothing is run")
    report = verbs.add_parser(
        "report", parents=[store, out, as_json], help="the page, its figures and tables from the store, nothing is run"
    )
    report.add_argument("--plan", metavar="NAME|FILE", help="the results of one plan, default all")
    recovery = verbs.add_parser(
        "recovery", parents=[store, out, as_json], help="how surely the missing effect is named"
    )
    recovery.add_argument("--plan", metavar="NAME|FILE", help="the cells of one plan, default every stored one")
    measured = verbs.add_parser("measured", parents=[out, as_json], help="measured cases judged on held-out parts")
    measured.add_argument("--only", metavar="PATTERN", help="cases with this in their name")
    measured.add_argument("--data", type=Path, metavar="DIR", help="folder of measured data that are not shipped")
    claims = verbs.add_parser("claims", parents=[as_json], help="published numbers beside ours")
    claims.add_argument("--brief", action="store_true", help="the ledger alone, without what the source leaves open")
    twins = verbs.add_parser("twin", parents=[as_json], help="the long twin experiments with published errors")
    twins.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="JSON file to write")
    twins.add_argument("--seeds", type=count, default=20, metavar="N", help="runs of each method, default 20")
    cost = verbs.add_parser("cost", parents=[out, as_json], help="run time a step against states and record length")
    cost.add_argument("--estimators", nargs="+", metavar="NAME", help="these alone, default all")
    one = verbs.add_parser("table1", parents=[out, as_json], help="the sources' Table 1 and what better methods reach")
    one.add_argument("--seeds", type=count, default=5, metavar="N", help="seeds of the comparison, default 5")


def count(text: str) -> int:
    """A number of a command line, from 1."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text}: expected a number above zero")
    return value


def run(args: argparse.Namespace) -> int:
    """Run a verb; 0 done, 2 by InputError."""
    verb = {
        "list": _list, "run": _run, "tune": _run, "table": _table, "plot": _plot, "report": _report,
        "recovery": _recovery, "claims": _claims, "measured": _measured, "table1": _table_one,
        "twin": _twin, "cost": _cost,
    }  # fmt: skip
    return verb[args.bench](args)


def _list(args: argparse.Namespace) -> int:
    from suite.benchmark import matrix, plan, table

    cells = matrix.chosen(plan.load(args.plan), args.only, args.seeds, args.data, args.estimators)
    if args.json:
        plans = {name: plan.load(name).sentence for name in plan.shipped()}
        print(table.to_json({"plans": plans, "plan": args.plan, "cells": [cell.label for cell in cells]}))
        return 0
    width = max(map(len, plan.shipped()))
    for name in plan.shipped():
        print(f"{name:{width}s}  {plan.load(name).sentence}")
    print(f"\n{args.plan}: {len(cells)} cells")
    # A whole plan in a line a case and estimator; what a pattern chose, cell by cell.
    names = [cell.label if args.only else f"{cell.case} {cell.estimator}" for cell in cells]
    print("\n".join(dict.fromkeys(names)))
    return 0


def _run(args: argparse.Namespace) -> int:
    from suite.benchmark import matrix, plan, table
    from suite.benchmark.store import Store

    if args.bench == "run" and args.collect:
        return _collect(args)
    chosen = plan.load(args.plan)
    cells = matrix.chosen(chosen, args.only, args.seeds, args.data, args.estimators)
    how = matrix.Running(
        jobs=args.jobs, limit=chosen.limit, memory=args.memory or chosen.memory, data=args.data, force=args.force,
        dask=args.dask, tuned_at=chosen.tuned_at,
        tuned_as=chosen.tuned_as,
    )  # fmt: skip
    with Store(args.store) as store:
        done = matrix.run(cells, store, how, tune_only=args.bench == "tune")
    if args.json:
        print(table.to_json(done))
    elif args.bench == "tune":
        print(f"{done['tuned']} tunings are in {args.store}")
    else:
        counts = ", ".join(f"{count} {status}" for status, count in sorted(done["status"].items())) or "none"
        print(f"{done['cells']} cells: {done['unchanged']} unchanged, {done['run']} run ({counts}); in {args.store}")
    return 0


def _collect(args: argparse.Namespace) -> int:
    from suite.benchmark import table
    from suite.benchmark.collect import collect
    from suite.benchmark.store import Store

    with Store(args.store) as store:
        taken = collect(store, args.collect)
    told = f"{taken['cells']} rows and {taken['tunings']} tunings were new or newer; in {args.store}"
    print(table.to_json({"collected": taken}) if args.json else told)
    return 0


def _table(args: argparse.Namespace) -> int:
    from suite.benchmark import plan, recovery_summary, table

    chosen = plan.load(args.plan) if args.plan else None
    rows, recovery = _stored(args.store, chosen)
    if args.only:
        rows = [row for row in rows if args.only in f"{row['case']} {row['estimator']} {row['variant']}"]
    shown = rows if args.rows else recovery_summary.targets(rows) if recovery else table.lines(rows)
    if args.output:
        table.write(shown, args.output)
        print(f"{len(shown)} lines in {args.output}", file=sys.stderr)
    if args.json or (args.rows and not args.output):
        print(table.to_json(shown))
    elif not args.output:
        print(recovery_summary.text(rows) if recovery else table.text(shown))
    return 0


def _stored(path: Path, chosen: Any) -> tuple[list[dict[str, Any]], bool]:
    """The rows of a plan, or of estimation where none is named; and whether they are of the recovery benchmark."""
    from suite.benchmark import recovery_summary
    from suite.benchmark.store import Store

    with Store(path, must_exist=True) as store:
        rows = store.rows()
    if chosen is not None and chosen.kind == "recovery":
        return [dict(row) for row in recovery_summary.chosen(rows, chosen.cells())], True
    rows = [row for row in rows if row.get("kind") != "recovery"]
    if chosen is not None:
        wanted = {(c.case, c.noise, c.estimator, c.variant) for c in chosen.cells()}
        rows = [row for row in rows if (row["case"], row["noise"], row["estimator"], row["variant"]) in wanted]
    return rows, False


def _recovery(args: argparse.Namespace) -> int:
    from suite.benchmark import plan, recovery_summary, table
    from suite.benchmark.store import Store
    from suite.errors import InputError
    from suite.report import recovery_page

    cells = plan.load(args.plan).cells() if args.plan else ()
    with Store(args.store, must_exist=True) as store:
        rows = recovery_summary.chosen(store.rows(), cells)
    if not rows:
        raise InputError(
            f"{args.store} holds no result of the recovery benchmark; run: unmodelled bench run --plan recovery"
        )
    paths = [str(path) for path in recovery_page.write(rows, args.output)]
    if args.json:
        print(table.to_json({"targets": recovery_summary.targets(rows), "files": paths}))
    else:
        print(recovery_summary.text(rows) + "\n\n" + "\n".join(paths))
    return 0


def _plot(args: argparse.Namespace) -> int:
    from suite.benchmark import table
    from suite.report import bench_figures

    rows, _ = _stored(args.store, None)
    paths = [str(path) for path in bench_figures.draw(rows, args.output)]
    print(table.to_json(paths) if args.json else "\n".join(paths))
    return 0


def _report(args: argparse.Namespace) -> int:
    from suite.benchmark import plan, table, tuning
    from suite.benchmark.store import Store
    from suite.errors import InputError
    from suite.report import bench_page

    rows, recovery = _stored(args.store, plan.load(args.plan) if args.plan else None)
    if recovery:
        raise InputError(f"plan {args.plan!r} is of the recovery benchmark; its page is made by: bench recovery")
    with Store(args.store, must_exist=True) as store:
        tunings = tuning.stored(store)
    made = bench_page.write(rows, tunings, args.output, str(args.store))
    print(table.to_json(made) if args.json else "\n\n".join(made["verdict"]) + "\n\n" + "\n".join(made["files"]))
    return 0


def _claims(args: argparse.Namespace) -> int:
    from suite.benchmark import claims, table

    ledger = claims.ledger()
    if args.json:
        print(table.to_json(ledger))
        return 0
    print(claims.text(ledger))
    if not args.brief:
        from suite.benchmark import table_one

        print("\n" + table_one.open_text())
    return 0


def _measured(args: argparse.Namespace) -> int:
    from suite.benchmark import held_out

    return held_out.verb(args)


def _table_one(args: argparse.Namespace) -> int:
    from suite.benchmark import table
    from suite.report import table_one_page

    made = table_one_page.write(args.output, args.seeds)
    print(table.to_json(made) if args.json else made["text"])
    return 0


def _cost(args: argparse.Namespace) -> int:
    from suite import plugins
    from suite.benchmark import cost, table
    from suite.errors import InputError
    from suite.report import cost_figures

    unknown = sorted(set(args.estimators or ()) - set(plugins.estimators()))
    if unknown:
        raise InputError(f"--estimators {', '.join(unknown)}: nothing is called that; see `unmodelled list`")
    rows = cost.measure(args.estimators, lambda text: print(text, file=sys.stderr))
    paths = [str(path) for path in cost_figures.write(rows, args.output)]
    print(table.to_json({"rows": rows, "files": paths}) if args.json else "\n".join(paths))
    return 0


def _twin(args: argparse.Namespace) -> int:
    from suite.benchmark import table, twin

    made = twin.write(args.output, args.seeds, lambda text: print(text, file=sys.stderr))
    print(table.to_json(made) if args.json else f"{args.output} holds {args.seeds} runs of {len(twin.METHODS)} methods")
    return 0
