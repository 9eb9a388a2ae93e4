"""Progress on standard error: a bar on a terminal, a plain line every ten seconds elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any


class Progress:
    """Counts steps of a total; silent for nothing to do."""

    def __init__(self, what: str, total: int, *, quiet: bool = False) -> None:
        self.what, self.total, self.done = what, total, 0
        self.quiet = quiet or total == 0
        self.start = self.said = time.monotonic()
        self.bar: Any = None

    def __enter__(self) -> Progress:
        if not self.quiet and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress as Bar

            self.bar = Bar(console=Console(stderr=True))
            self.bar.start()
            self.task = self.bar.add_task(self.what, total=self.total)
        return self

    def step(self, label: str) -> None:
        """One more is done."""
        self.done += 1
        if self.bar is not None:
            self.bar.update(self.task, advance=1, description=f"{self.what} {label}")
        elif not self.quiet and (time.monotonic() - self.said > 10.0 or self.done == self.total):
            self.said = time.monotonic()
            print(
                f"{self.what}: {self.done} of {self.total}, {self.said - self.start:.0f} s", file=sys.stderr, flush=True
            )

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self.bar is not None:
            self.bar.stop()
