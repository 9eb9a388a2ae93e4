"""`bench table1`: Table 1, what it leaves open, what better methods reach, as Markdown, JSON and figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from suite.benchmark import better, claims, table_one
from suite.benchmark.table import grid, markdown, to_json
from suite.files import writable_folder, write_whole
from suite.report import table_one_figures


def write(folder: Path, seeds: int) -> dict[str, Any]:
    """Write table1.md, table1.json and the figures to `folder`; the paths and the text that is printed."""
    writable_folder(folder)
    ledger = claims.ledger()
    entries = better.table(seeds)
    title = f"a3 by method over {seeds} seeds, mean +- sd in 1e-4"
    note = "Noise is absolute and known, x0 = 0 is known; tuned by likelihood on the record itself. " + METHOD_NOTE
    blocks = [(f"{title}; {' and '.join(m)} measured", better.cells(entries, m)) for m in better.MEASURED]
    text = "\n\n".join(
        [claims.text(ledger), table_one.open_text(), *(f"{head}\n\n{grid(cells)}" for head, cells in blocks)]
    )
    page = "\n\n".join(
        [
            "# Table 1, reconstructed",
            f"{claims.SOURCE}. A reconstruction, one of many: {table_one.Setting().sentence}.",
            markdown(claims.cells(ledger)),
            "## What the source does not state, moved one at a time",
            markdown(table_one.cells()),
            "## What better methods reach",
            note,
            *(f"### {head}\n\n{markdown(cells)}" for head, cells in blocks),
            "![Figure 1](figure-1.svg)\n\n![a3 by method](a3-by-method.svg)\n",
        ]
    )
    write_whole(folder / "table1.md", page)
    rows = [
        {"method": e.method, "measured": list(e.measured), "noise": e.noise, "a3": list(e.values), "reason": e.reason}
        for e in entries
    ]
    stored = {"claims": ledger, "open": table_one.cells(), "methods": rows, "seeds": seeds}
    write_whole(folder / "table1.json", to_json(stored) + "\n")
    figures = [*table_one_figures.figure_one(folder), *table_one_figures.comparison(entries, folder)]
    paths = [folder / "table1.md", folder / "table1.json", *figures]
    return {**stored, "text": text, "files": [str(path) for path in paths]}


METHOD_NOTE = (
    "The filters' and smoothers' a3 is the regression of their d on x2^3, a first look that falls short as the noise "
    "grows; the number to give is the maximum-likelihood refit of the completed model."
)
