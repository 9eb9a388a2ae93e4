"""The ledger of published numbers beside ours; what can be computed in seconds is computed on the spot."""

from __future__ import annotations

from typing import Any

from suite.benchmark import claims_twin
from suite.benchmark.table import grid
from suite.benchmark.table_one import PUBLISHED, Setting, numbers

SOURCE = "Raol and others (2016), IJERSTE 5(7), Table 1"


def ledger() -> list[dict[str, Any]]:
    """Rows {"id", "source", "setting", "published", "ours", "tolerance", "status"}; the tolerance is relative.

    Status: "reproduced" (within the tolerance), "differs", "setting not published" (there is no number to compare),
    "not computed" (a long run whose results are not here).
    """
    base = numbers(Setting())
    setting = f"a reconstruction, one of many: {Setting().sentence}"
    rows = [
        _row(f"table1-{method}-{what}", setting, published, base[method, what], 0.01)
        for (method, what), published in PUBLISHED.items()
    ]
    printed = PUBLISHED["generalized", "J"] / PUBLISHED["conventional", "J"]
    ratio = base["generalized", "J"] / base["conventional", "J"]
    rows.append(_row("table1-J-ratio", setting, printed, ratio, 0.02))
    rows.append(
        _row(
            "table1-alpha",
            "alpha of the generalized estimator; ours is chosen to meet a3 and J",
            None,
            Setting().alpha,
            0,
        )
    )
    return [*rows, *claims_twin.rows()]


def _row(name: str, setting: str, published: float | None, ours: float, tolerance: float) -> dict[str, Any]:
    status = "setting not published"
    if published is not None:
        status = "reproduced" if abs(ours - published) <= tolerance * abs(published) else "differs"
    values = {"published": published, "ours": ours, "tolerance": tolerance, "status": status}
    return {"id": name, "source": SOURCE, "setting": setting, **values}


def cells(rows: list[dict[str, Any]]) -> list[list[str]]:
    """The ledger as rows of text; the first is the heading."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.5g}"

    heading = ["claim", "published", "ours", "tolerance", "status"]
    lines = [[r["id"], number(r["published"]), number(r["ours"]), f"{r['tolerance']:.0%}", r["status"]] for r in rows]
    return [heading, *lines]


def text(rows: list[dict[str, Any]]) -> str:
    """The ledger as a table for each source."""
    sources = dict.fromkeys(row["source"] for row in rows)
    return "\n\n".join(f"{source}\n\n" + grid(cells([r for r in rows if r["source"] == source])) for source in sources)
