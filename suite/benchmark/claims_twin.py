"""The published errors of the twin experiments beside ours: one run on the spot, many from the committed results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import suite
from suite.benchmark import twin
from suite.errors import DataError

# Where `unmodelled bench twin` has written: here, or in the clone that the package runs from.
PLACES = (Path("results/twin.json"), Path(suite.__file__).parent.parent / "results" / "twin.json")
# A run of 1000 readings scatters by a few per cent; where a filter loses the path for a while, by more.
TOLERANCE = 0.1
ON_THE_SPOT = ("extkf", "enkf-sqrt-10")
GIVEN = "Lorenz-63, a reading of all states (variance 2) every 25 steps of 0.01, 1000 readings, time 16 burnt in"


def rows() -> list[dict[str, Any]]:
    """The rows of the ledger: one run each of the quick methods, then the means over runs of all methods."""
    made = []
    for name in ON_THE_SPOT:
        method = twin.METHODS[name]
        made.append(_row(f"twin-{name}-one-run", f"{method.sentence}; {GIVEN}; one run", method, twin.error(name, 0)))
    found = stored()
    for name, method in twin.METHODS.items():
        errors = found["errors"].get(name) if found is not None else None
        if found is None or not errors:
            said = "not computed here; run: unmodelled bench twin -o results/twin.json"
            made.append(_row(f"twin-{name}", f"{method.sentence}; {GIVEN}; {said}", method, None))
            continue
        half = 2.0 * np.std(errors, ddof=1) / np.sqrt(len(errors))
        said = f"mean of {len(errors)} runs +- {half:.2g}, median {np.median(errors):.3f}, of {found['date']}"
        made.append(_row(f"twin-{name}", f"{method.sentence}; {GIVEN}; {said}", method, float(np.mean(errors))))
    return made


def stored() -> dict[str, Any] | None:
    """The newest results of `unmodelled bench twin`, or None; DataError where a file is none of its."""
    found: list[dict[str, Any]] = []
    for path in dict.fromkeys(place.resolve() for place in PLACES if place.is_file()):
        try:
            table = json.loads(path.read_text(encoding="utf-8"))
            found.append({"date": str(table["date"]), "errors": {n: list(e) for n, e in table["errors"].items()}})
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise DataError(f"{path}: not a file of `unmodelled bench twin`; write it anew with -o {path}") from None
    return max(found, key=lambda table: str(table["date"])) if found else None


def _row(name: str, setting: str, method: twin.Method, ours: float | None) -> dict[str, Any]:
    status = "not computed"
    if ours is not None:
        status = "reproduced" if abs(ours - method.published) <= TOLERANCE * method.published else "differs"
    values = {"published": method.published, "ours": ours, "tolerance": TOLERANCE, "status": status}
    return {"id": name, "source": twin.SOURCE, "setting": setting, **values}
