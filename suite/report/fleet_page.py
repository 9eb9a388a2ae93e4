"""The report of a fleet: one page that opens anywhere, without scripts, small also for ten thousand machines."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import date as calendar
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from suite import __version__
from suite.discovery import words
from suite.files import write_whole
from suite.fleet import ranking
from suite.fleet.stored import Brief
from suite.model import Model
from suite.report import fleet_figures
from suite.report.vector import share, svg

Row = Mapping[str, Any]
SHOWN = 200  # machines in the table of the page
REASONS = 60  # kinds of failure on the page


def write(
    briefs: Sequence[Brief], first: Sequence[Row], model: Model, command: str, path: Path, date: str = ""
) -> None:
    """Write the page of a ranking and the whole rows of its first judged files, SHOWN at most.

    `command` is the line that repeats the run, `date` today if empty.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    figures = {"bars": fleet_figures.bars(briefs), "ranking": fleet_figures.ranking(briefs)}
    drawn = {name: figure for name, figure in figures.items() if figure is not None}
    shared, letters = share({name: svg(figure, name) for name, figure in drawn.items()})
    page = environment.get_template("fleet.html.j2").render(
        model=model.name,
        outputs=list(model.outputs),
        sentence=ranking.sentence(briefs),
        letters=Markup(letters),
        figures={name: Markup(text) for name, text in shared.items()},
        says={name: str(figure.get_label()) for name, figure in drawn.items()},
        rows=[
            _line(brief, row) | {"rank": str(k + 1)} for k, (brief, row) in enumerate(zip(briefs, first, strict=False))
        ],
        judged=len(ranking.judged(briefs)),
        files=len(briefs),
        failures=ranking.failures(briefs),
        reasons=REASONS,
        command=command,
        version=__version__,
        date=date or calendar.today().isoformat(),
    )
    write_whole(path, page)


def _line(brief: Brief, row: Row) -> dict[str, str]:
    """A machine as a line of the table."""
    name, certain = ranking.group(brief)
    return {
        "file": brief.file,
        "ratio": ranking.ratio(brief.ratio),
        "missing": name if certain else f"most likely {name}",
        "others": "" if certain else str(row["plausible"]),
        "weight": words.weight(brief.weight) if brief.effects else "",
        "coefficients": _coefficients(str(row["coefficients"])),
    }


def _coefficients(text: str) -> str:
    """'c = 0.15 +- 0.01 N' of each fitted number of the effects."""
    return ", ".join(
        f"{name} = {words.value_sd(entry['value'], entry['sd'])}{' ' + entry['unit'] if entry.get('unit') else ''}"
        for effect in json.loads(text or "[]")
        for name, entry in effect["coefficients"].items()
    )
