"""The tables of docs/tests.md: `python tests/mutation/summary.py MUTATION COVERAGE --page docs/tests.md`."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- tests -->", "<!-- end -->"
ROOMS = ("suite/kernels", "suite/discovery", "suite/benchmark")


def noticed(report: dict[str, Any]) -> str:
    """A line a room, and one of all."""
    lines = ["| mistakes in | made | noticed | share |", "|---|---|---|---|"]
    total: dict[str, int] = {}
    for room, counts in report["rooms"].items():
        lines.append(_line(f"`{room}`", counts))
        for outcome, count in counts.items():
            total[outcome] = total.get(outcome, 0) + count
    return "\n".join([*lines, _line("all", total)])


def _line(name: str, counts: dict[str, int]) -> str:
    killed = counts.get("killed", 0)
    made = killed + counts.get("survived", 0)
    return f"| {name} | {made} | {killed} | {100 * killed / max(made, 1):.0f} % |"


def covered(report: dict[str, Any]) -> str:
    """A line a room, and one of all: lines and branches that the tests run."""
    lines = ["| room | lines and branches | run by the tests |", "|---|---|---|"]
    rooms: dict[str, tuple[int, int]] = {}
    for path, entry in report["files"].items():
        if Path(path).is_absolute():  # a copy that a test made of the project, or a plug-in that it wrote
            continue
        room = next((room for room in ROOMS if path.startswith(f"{room}/")), path.split("/")[0])
        found = entry["summary"]
        have, ran = rooms.get(room, (0, 0))
        whole = found["num_statements"] + found["num_branches"]
        rooms[room] = have + whole, ran + found["covered_lines"] + found["covered_branches"]
    for room, (have, ran) in sorted(rooms.items()):
        name = "other files of `suite`" if room == "suite" else f"`{room}`"
        lines.append(f"| {name} | {have} | {100 * ran / max(have, 1):.1f} % |")
    have, ran = (sum(pair[k] for pair in rooms.values()) for k in (0, 1))
    return "\n".join([*lines, f"| all | {have} | {100 * ran / max(have, 1):.1f} % |"])


def main() -> int:
    """Put the tables into a page."""
    parser = argparse.ArgumentParser(prog="summary", description=__doc__)
    parser.add_argument("mutation", type=Path, metavar="MUTATION")
    parser.add_argument("coverage", type=Path, metavar="COVERAGE")
    parser.add_argument("--page", type=Path, metavar="FILE", help="page that gets the tables between its marks")
    args = parser.parse_args()
    mutation, coverage = (json.loads(path.read_text(encoding="utf-8")) for path in (args.mutation, args.coverage))
    made = f"Measured {mutation['date']}: `{mutation['command']}`, Cosmic Ray {mutation['versions']['cosmic-ray']}."
    kernels = "The bodies of compiled kernels are not traced and not counted here; their mistakes are, above."
    text = f"{noticed(mutation)}\n\n{made}\n\n{covered(coverage)}\n\n{kernels}\n"
    if args.page is not None:
        before, rest = args.page.read_text(encoding="utf-8").split(BEGIN)
        args.page.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{rest.split(END)[1]}", encoding="utf-8")
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
