"""What throughput.json says, as the tables of docs/fleet.md between its marks.

python bench/fleet_page.py results/fleet/throughput.json docs/fleet.md
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

START, END = "<!-- fleet: measured -->", "<!-- end -->"
# The names in `each`, the factor to the unit, the unit, and what it is.
LINES = (
    ("verdict_cpu_s", 1.0, "s", "a verdict, processor of a worker"),
    ("task_cpu_s", 1e3, "ms", "to a process and back, processor of the parent"),
    ("store_cpu_s", 1e3, "ms", "reservation, row, ranking and tables, processor of the parent"),
    ("dask_client_cpu_s", 1e3, "ms", "to a Dask cluster and back, processor of the parent"),
    ("dask_scheduler_cpu_s", 1e3, "ms", "processor of the Dask scheduler"),
    ("unchanged_cpu_s", 1e3, "ms", "an unchanged file of a run that goes on, processor of the parent"),
    ("parent_kib", 1.0, "KiB", "memory of the parent"),
    ("store_kib", 1.0, "KiB", "size in `fleet.sqlite`"),
)


def told(found: Mapping[str, Any]) -> str:
    """The tables of one measurement."""
    busy = found["cores_got"] < 0.9 * found["jobs"]
    shared = f" Other work shared the machine; the run had {found['cores_got']:.2f} cores." if busy else ""
    million, each = found["million"], found["each"]
    rows = [f"| {what} | {each[name] * factor:.3g} {unit} |" for name, factor, unit, what in LINES]
    machine = found["machine"]
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
    bound = max(("cores_s", "parent_s", "scheduler_s"), key=lambda name: million[name])
    said = {"cores_s": "the cores", "parent_s": "the parent", "scheduler_s": "the scheduler"}
    return "\n".join(
        [
            f"{found['files']} files on {found['jobs']} processes took {found['run']['wall_s']:.0f} s: "
            f"{found['files_per_s']:.3g} files a second.{shared} A file costs",
            "",
            "| what | a file |",
            "|---|---|",
            *rows,
            "",
            f"The report of {found['rows']} machines has {found['bytes_of_rows']['report.html'] / 1e6:.2f} MB. "
            f"Measured on {found['date']}: {machine['processor']}, {machine['cores']} cores, {versions}.",
            "",
            f"For {million['files']} files on {million['cores']} cores:",
            "",
            "| bound | seconds |",
            "|---|---|",
            f"| the cores, N s / C | {million['cores_s']:.0f} |",
            f"| the parent, N (a + c) | {million['parent_s']:.0f} |",
            f"| the scheduler, N d | {million['scheduler_s']:.0f} |",
            "",
            f"So it would take {million[bound] / 60:.0f} minutes, and {said[bound]} would set the pace; "
            f"one parent keeps {million['cores_kept_busy']:.0f} cores busy. "
            f"The parent would hold {million['parent_gib']:.2g} GiB, `fleet.sqlite` {million['store_gib']:.2g} GiB.",
        ]
    )


def with_tables(page: str, found: Mapping[str, Any]) -> str:
    """The page with these tables between its marks."""
    before, rest = page.split(START)
    after = rest.split(END, 1)[1]
    return f"{before}{START}\n\n{told(found)}\n\n{END}{after}"


if __name__ == "__main__":
    stored, page = map(Path, sys.argv[1:])
    text = with_tables(page.read_text(encoding="utf-8"), json.loads(stored.read_text(encoding="utf-8")))
    page.write_text(text, encoding="utf-8")
