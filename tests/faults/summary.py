"""The table of a page from reports: `python tests/faults/summary.py results/faults.json --page docs/faults.md`."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- faults -->", "<!-- end -->"


def table(report: dict[str, Any]) -> str:
    """A line a scenario, and one of all."""
    rows = [("fault", "made", "with a defect", "how the commands ended")]
    rows += [
        (_title(entry), str(_made(entry)), str(len(entry["faults"])), _ends(entry)) for entry in report["scenarios"]
    ]
    made = sum(map(_made, report["scenarios"]))
    rows.append(("all", str(made), str(sum(len(entry["faults"]) for entry in report["scenarios"])), ""))
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|---|---|---|---|", *lines[1:]]) + "\n"


def _title(entry: dict[str, Any]) -> str:
    return str(entry["scenario"])


def _made(entry: dict[str, Any]) -> int:
    return int(entry.get("kills", entry.get("tried", 0)))


def _ends(entry: dict[str, Any]) -> str:
    if "kills" in entry:
        whom = ", ".join(f"{name} {count}" for name, count in sorted(entry["of"].items()))
        rounds = f"{entry['rounds']} round{'' if entry['rounds'] == 1 else 's'}"
        return f"killed: {whom}; then resumed, to the end in {rounds}"
    if entry.get("skipped"):
        return f"not made: {entry['skipped']}"
    return ", ".join(f"{code}: {count}" for code, count in sorted(entry["codes"].items()))


def main() -> int:
    """Merge reports into one, and put its table into a page."""
    parser = argparse.ArgumentParser(prog="summary", description=__doc__)
    parser.add_argument("reports", type=Path, nargs="+", metavar="FILE")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="all of them as one report")
    parser.add_argument("--page", type=Path, metavar="FILE", help="page that gets the table between its marks")
    args = parser.parse_args()
    reports = [json.loads(path.read_text(encoding="utf-8")) for path in args.reports]
    merged = {"seed": reports[0]["seed"], "scenarios": [entry for report in reports for entry in report["scenarios"]]}
    if args.output is not None:
        args.output.write_text(json.dumps(merged, indent=1) + "\n", encoding="utf-8")
    if args.page is not None:
        before, rest = args.page.read_text(encoding="utf-8").split(BEGIN)
        page = f"{before}{BEGIN}\n\n{table(merged)}\n{END}{rest.split(END)[1]}"
        args.page.write_text(page, encoding="utf-8")
    print(table(merged), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
