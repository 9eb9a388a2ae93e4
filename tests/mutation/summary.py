"""The tables of docs/tests.md: `python tests/mutation/summary.py MUTATION... COVERAGE --page docs/tests.md`."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- tests -->", "<!-- end -->"
ROOMS = ("suite/kernels", "suite/discovery", "suite/benchmark")


def noticed(reports: Sequence[dict[str, Any]]) -> str:
    """A line a room and sample, and one of all of a sample."""
    lines = ["| mistakes in | sample | made | noticed | share |", "|---|---|---|---|---|"]
    for report in reports:
        total: Counter[str] = Counter()
        for room, counts in report["rooms"].items():
            lines.append(_line(f"`{room}`", report["seed"], counts))
            total.update(counts)
        lines.append(_line("all", report["seed"], total))
    return "\n".join(lines)


def _line(name: str, seed: int, counts: Mapping[str, int]) -> str:
    killed = counts.get("killed", 0)
    made = killed + counts.get("survived", 0)
    return f"| {name} | {seed} | {made} | {killed} | {100 * killed / max(made, 1):.0f} % |"


def unnoticed(reports: Sequence[dict[str, Any]]) -> str:
    """Every mistake that no test noticed, with the line as it is and as it was made."""
    lines = ["| not noticed | the line | with the mistake |", "|---|---|---|"]
    for report in reports:
        for entry in (entry for entry in report["mutants"] if entry["outcome"] == "survived"):
            place = entry["key"].split(" ")[0].rpartition(":")[0]
            cells = [line[1:].strip().replace("|", "\\|") for line in entry["change"]] or ["", entry["by"]]
            lines.append(f"| `{place}` | `{cells[0]}` | `{cells[-1]}` |")
    return "\n".join(lines)


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


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def main() -> int:
    """Put the tables into a page."""
    parser = argparse.ArgumentParser(prog="summary", description=__doc__)
    parser.add_argument("mutation", type=Path, nargs="+", metavar="MUTATION")
    parser.add_argument("coverage", type=Path, metavar="COVERAGE")
    parser.add_argument("--page", type=Path, metavar="FILE", help="page that gets the tables between its marks")
    args = parser.parse_args()
    reports, coverage = list(map(_read, args.mutation)), _read(args.coverage)
    last = reports[-1]
    made = (
        f"Measured {last['date']} with Cosmic Ray {last['versions']['cosmic-ray']}: "
        + ", ".join(f"`{report['command']}`" for report in reports)
        + "."
    )
    kernels = "The bodies of compiled kernels are not traced and not counted here; their mistakes are, above."
    text = "\n\n".join([noticed(reports), made, unnoticed(reports), covered(coverage), kernels]) + "\n"
    if args.page is not None:
        before, rest = args.page.read_text(encoding="utf-8").split(BEGIN)
        args.page.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{rest.split(END)[1]}", encoding="utf-8")
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
