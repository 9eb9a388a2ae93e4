"""From pytest-benchmark's JSON to a table: `python bench/summary.py results/speed.json results/speed.md`.

Files after these two are pages that hold the table between two marks.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))
MARKS = ("<!-- speed -->", "<!-- /speed -->")
HEAD = "| What | Ours | Theirs | Ratio | Wanted | Reached |\n|---|---|---|---|---|---|"


def shown(seconds: float) -> str:
    """A time to three digits in its own unit."""
    scale, unit = next((pair for pair in UNITS if seconds >= pair[0]), UNITS[-1])
    return f"{seconds / scale:.3g} {unit}"


def _digits(ratio: float) -> str:
    """Three digits, and no exponent."""
    return f"{ratio:,.0f}" if ratio >= 100.0 else f"{ratio:.3g}"


def row(entry: dict[str, Any]) -> str:
    """One comparison; a ratio below 1 is a peer that is ahead."""
    note = entry["extra_info"]
    ours, theirs, ratio = f"{shown(note['ours'])} a {note['unit']}", "", ""
    if "peer" in note:
        theirs, faster = f"{shown(note['theirs'])}, {note['peer']}", note["theirs"] / note["ours"]
        ratio = f"{_digits(faster)} times as fast" if faster >= 1.0 else f"{1.0 / faster:.2g} times the time"
    return f"| {note['what']} | {ours} | {theirs} | {ratio} | {note['wanted']} | {'yes' if note['reached'] else 'no'} |"


def table(report: dict[str, Any]) -> str:
    """Where and when it was measured, then a row for each comparison."""
    machine = report["machine_info"]
    versions = ", ".join(f"{name} {version}" for name, version in machine.get("versions", {}).items())
    entries = [entry for entry in report["benchmarks"] if "what" in entry["extra_info"]]
    measured = (
        f"{machine['cpu']['brand_raw']}, {machine['cpu']['count']} cores, {machine['system']}, "
        f"Python {machine['python_version']}; {versions}; {report['datetime'][:10]}."
    )
    return "\n".join([measured, "", HEAD, *map(row, entries)])


def main(given: Path, written: Path, *pages: Path) -> None:
    """Write the table, and put it into the pages."""
    text = table(json.loads(given.read_text(encoding="utf-8")))
    written.write_text(
        f"# Speed\n\nProcessor times, the least of several, compiling outside (`tox run -e bench`).\n\n{text}\n",
        encoding="utf-8",
    )
    for page in pages:
        before, _, rest = page.read_text(encoding="utf-8").partition(MARKS[0])
        _, _, after = rest.partition(MARKS[1])
        page.write_text(f"{before}{MARKS[0]}\n{text}\n{MARKS[1]}{after}", encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
