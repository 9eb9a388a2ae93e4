"""What the recovery benchmark writes: tables in every format, figures as SVG and PNG, and the text of the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from suite.benchmark import recovery_summary as summary
from suite.benchmark import table
from suite.files import writable_folder, write_whole, written_whole
from suite.report import recovery_figures
from suite.report.vector import svg

Row = Mapping[str, Any]


def write(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Write everything to a folder; the paths written."""
    writable_folder(folder)
    paths = []
    tables: dict[str, Sequence[Row]] = {
        "rows": list(rows), "must-reach": summary.targets(rows), "by-case": summary.by_case(rows),
        "by-method": summary.by_method(rows), "by-condition": summary.by_condition(rows),
    }  # fmt: skip
    for name, lines in tables.items():
        for ending in (".csv", ".parquet", ".json") if lines else ():
            table.write(_words(lines), folder / f"{name}{ending}")
            paths.append(folder / f"{name}{ending}")
    for name, figure in recovery_figures.drawn(rows).items():
        for ending in (".svg", ".png"):
            path = folder / f"{name}{ending}"
            if ending == ".svg":
                write_whole(path, svg(figure, name) + "\n")
            else:
                with written_whole(path) as beside:
                    figure.savefig(beside, format="png", dpi=120)
            paths.append(path)
    path = folder / "recovery.md"
    parts = [f"## {heading}\n\n{table.markdown(cells)}" for heading, cells in summary.written(rows).items()]
    write_whole(path, "\n\n".join(parts) + "\n")
    return [*paths, path]


def _words(lines: Sequence[Row]) -> list[dict[str, Any]]:
    """Lines whose lists are words, as a flat table needs."""
    return [{k: " | ".join(map(str, v)) if isinstance(v, list) else v for k, v in line.items()} for line in lines]
