"""The ranking of a fleet, its sentence, and the page that shows it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from suite.fleet import ranking
from suite.fleet.stored import Brief
from suite.model_file import read_model
from suite.report import fleet_page


def brief(file: str, verdict: str, effects: str = "", ratio: float = 1.0, weight: float = 0.0) -> Brief:
    return Brief(f"/{file}", file, "ok" if verdict else "refused", "", verdict, effects, weight, ratio)


def test_the_worst_comes_first_and_what_is_not_judged_last() -> None:
    """What ran away is worst; the weight decides between equals; the sentence counts everyone once."""
    given = [
        brief("a", ""),
        brief("b", "adequate", ratio=1.01),
        brief("c", "missing_effect", "x@v", 3.0, 0.9),
        brief("d", "ambiguous", "y@v", 3.0, 0.95),
        brief("e", "unexplained", ratio=math.inf),
    ]
    ranking_ = ranking.ranked(given)
    assert "".join(entry.file for entry in ranking_) == "edcba"
    assert len(ranking.judged(ranking_)) == 4
    assert ranking.sentence(ranking_) == (
        "Of 5 machines, 1 follows the model; 1 lacks x in v; "
        "1 lacks an effect not told from others, most likely y in v; "
        "1 fails in a way that the library does not explain; 1 could not be judged."
    )


def test_the_report_of_ten_thousand_machines_stays_small(tmp_path: Path) -> None:
    """Below 2 MB, also where every other file fails for a reason of its own; names are text, never markup."""
    given = [brief(f"<b>{k}.csv", "missing_effect", f"effect_{k % 40}@v", 1.0 + k, 0.9) for k in range(5000)]
    given += [replace(brief(f"{k}", ""), reason="word " * 50 + "x" * (k % 100)) for k in range(5000)]
    briefs = ranking.ranked(given)
    model = read_model(Path(__file__).with_name("decay.toml"))
    shown: dict[str, Any] = {"plausible": "", "coefficients": "[]"}
    fleet_page.write(briefs, [shown] * fleet_page.SHOWN, model, "unmodelled", tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert len(page) < 2_000_000
    assert "<b>" not in page
