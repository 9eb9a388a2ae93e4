"""What a scenario has found, and the check that every fault must pass: a sentence, its exit code, whole files."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import whole
from process import Ended


@dataclass
class Outcome:
    """How often a fault was made, what went wrong, or why it could not be made here."""

    scenario: str
    tried: int = 0
    faults: list[str] = field(default_factory=list)
    skipped: str = ""
    codes: dict[str, int] = field(default_factory=dict)

    def expect(self, holds: bool, sentence: str) -> None:
        """A fault where something does not hold."""
        if not holds:
            self.faults.append(sentence)

    def check(
        self,
        what: str,
        ended: Ended,
        codes: Collection[int],
        folder: Path | None = None,
        words: str = "",
        heard: bool = True,
    ) -> None:
        """The exit code is one of these, what is said is no traceback and holds the words, no file is half written."""
        self.tried += 1
        self.codes[str(ended.code)] = self.codes.get(str(ended.code), 0) + 1
        said = ended.err.strip().splitlines()[-1:] or [""]
        self.expect(ended.code in codes, f"{what}: exit code {ended.code}, {said[0][:300]}")
        self.expect(not ended.traceback, f"{what}: {(ended.err + ended.out)[-600:]}")
        self.expect(words in ended.err, f"{what}: {words!r} is not in {ended.err[-300:]!r}")
        if heard and ended.code == 2:
            self.expect(said[0].startswith("unmodelled: "), f"{what}: no sentence, {ended.err[-300:]!r}")
        if folder is not None:
            for sentence in whole.broken(folder):
                self.faults.append(f"{what}: half written: {sentence}")

    def to_json(self) -> dict[str, Any]:
        """For the report."""
        kept = {"scenario": self.scenario, "tried": self.tried, "codes": self.codes, "faults": self.faults}
        return kept | ({"skipped": self.skipped} if self.skipped else {})
