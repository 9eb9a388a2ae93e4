"""The runs that are killed: a small plan of the benchmark, a small fleet, a short discovery."""

from __future__ import annotations

import csv
import json
import math
import random
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PLAN = """
cases = ["paper-cubic"]
estimators = ["ekf", "generalized-ie"]
variants = ["default", "tuned"]
noises = [0.05]
seeds = 16
limit = 120
[[rules]]
estimators = ["ekf"]
variants = ["default"]
because = "its tuning takes as long as all else"
"""
COOLING = """
name = "cooling"
[states]
T = "-k*(T - 20)"
[parameters]
k = { value = 0.1, sd = 0.01 }
[outputs]
T = { equation = "T", column = "T", sigma = 0.1 }
[initial]
T = { value = 80.0, estimate = true }
"""
# What differs from run to run: times, memory, and what holds them.
TIMES = ("seconds", "step_us", "peak_mb", "when", "sentence")


@dataclass(frozen=True)
class Subject:
    """A command; `store` and `made` are files that it writes in its folder, `parts` how many rows its store gets."""

    name: str
    words: Sequence[str]
    made: str
    store: str = ""
    parts: int = 1
    workers: bool = False

    def prepare(self, folder: Path) -> None:
        """Write what the command reads."""
        folder.mkdir(parents=True)
        (folder / "plan.toml").write_text(PLAN)
        (folder / "model.toml").write_text(COOLING)
        for k in range(FILES):
            (folder / f"mug{k}.csv").write_text(_cooling(k))

    def rows(self, folder: Path) -> dict[Any, tuple[Any, ...]]:
        """Every finished part by what it is of, with all that is stored of it."""
        if not self.store or not (folder / self.store).exists():
            return {}
        with closing(sqlite3.connect(folder / self.store, timeout=60)) as connection:
            if not connection.execute("SELECT count(*) FROM sqlite_master WHERE name = 'cells'").fetchone()[0]:
                return {}
            cells = connection.execute("SELECT * FROM cells").fetchall()
            tunings = connection.execute("SELECT * FROM tunings").fetchall()
        return {row[:5]: row for row in cells} | {row[:1]: row for row in tunings}

    def outcome(self, folder: Path) -> Any:
        """What the command has found, without what differs from run to run."""
        path = folder / self.made
        if path.suffix == ".csv":
            with path.open(encoding="utf-8", newline="") as lines:
                rows = [_lasting(row) for row in csv.DictReader(lines)]
            return sorted(rows, key=lambda row: str(row["file"]))
        if path.suffix == ".json":
            return _lasting(json.loads(path.read_text(encoding="utf-8")))
        found = {key: json.loads(row[-2]) for key, row in self.rows(folder).items()}
        return {key: _lasting(row) for key, row in sorted(found.items())}


FILES = 12
SUBJECTS = {
    "bench": Subject(
        "bench", ("bench", "run", "--plan", "plan.toml", "--store", "out.sqlite", "--jobs", "1"),
        "out.sqlite", "out.sqlite", 49, True,
    ),
    "fleet": Subject(
        "fleet", ("diagnose", "model.toml", "mug*.csv", "--each", "-o", "out", "--jobs", "1"),
        "out/fleet.csv", "out/fleet.sqlite", FILES, True,
    ),
    "discover": Subject(
        "discover", ("discover", "model.toml", "mug0.csv", "-o", "out"), "out/ledger.json"
    ),
}  # fmt: skip


def _cooling(seed: int) -> str:
    """A mug that loses heat faster than Newton's law has it, in a third of the files."""
    rng, temperature, lines = random.Random(seed), 80.0 + seed, ["t,T"]
    for k in range(60):
        lines.append(f"{k},{temperature + rng.gauss(0.0, 0.1):.3f}")
        for _ in range(100):
            excess = temperature - 20.0
            temperature -= 0.01 * (0.1 * excess + (0.001 * excess**2 if seed % 3 == 0 else 0.0))
    return "\n".join(lines) + "\n"


def _lasting(found: Any) -> Any:
    if isinstance(found, dict):
        return {str(key): _lasting(value) for key, value in found.items() if key not in TIMES}
    if isinstance(found, list):
        return [_lasting(value) for value in found]
    return None if isinstance(found, float) and math.isnan(found) else found
