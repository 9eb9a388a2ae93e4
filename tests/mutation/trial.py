"""One mistake made in a copy of the project, and what the tests say of it."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from cosmic_ray.mutating import mutate_and_test
from mutants import Mutant

LIMIT = 900.0  # seconds; a mistake that never ends is noticed


def _command(place: Path, cache: str, tests: list[str]) -> list[str]:
    """The tests of a copy of the project, whose code is what they import."""
    os.chdir(place)
    os.environ |= {"PYTHONPATH": str(place), "UNMODELLED_CACHE": str(place / cache), "MPLBACKEND": "Agg"}
    return [sys.executable, "-m", "pytest", "--exitfirst", "--quiet", "-p", "no:cacheprovider", *tests]


def tried(mutant: Mutant, tests: list[str], place: Path) -> dict[str, Any]:
    """Killed or survived, with the change itself, how many tests were asked, and the one that noticed.

    A test that fails without the mistake too has noticed nothing: its mistake is `unsure`, and counts as neither.
    """
    begun = time.monotonic()
    entry: dict[str, Any] = {"key": mutant.key, "room": mutant.room, "tests": len(tests)}
    if not tests:
        return {**entry, "outcome": "survived", "seconds": 0.0, "change": [], "by": "no test runs this line"}
    # Kernels with a mistake are of no further use; what the sound ones compiled to serves every other mistake.
    cache = ".compiled-wrong" if mutant.room == "suite/kernels" else ".compiled"
    result = mutate_and_test([mutant.spec(place)], shlex.join(_command(place, cache, tests)), LIMIT)
    shutil.rmtree(place / ".compiled-wrong", ignore_errors=True)
    changed = [line for line in (result.diff or "").splitlines() if line[:1] in "+-" and line[:3] not in ("+++", "---")]
    outcome = result.test_outcome.value if result.test_outcome is not None else result.worker_outcome.value
    said = [line for line in (result.output or "").splitlines() if line.startswith(("FAILED", "ERROR", "timeout"))]
    by = said[0] if said else ""
    if outcome == "killed" and _fails_anyway(by, place):
        outcome = "unsure"
    return {**entry, "outcome": outcome, "seconds": time.monotonic() - begun, "change": changed, "by": by[:200]}


def _fails_anyway(by: str, place: Path) -> bool:
    """Whether the test that failed does so where nothing is wrong."""
    kind, _, rest = by.partition(" ")
    test = rest.partition(" - ")[0]
    if kind not in ("FAILED", "ERROR"):
        return False
    options = ["--collect-only"] if "::" not in test else []
    return subprocess.run(_command(place, ".compiled", [*options, test]), capture_output=True).returncode != 0
