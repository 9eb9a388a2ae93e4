"""kill -9 at random moments of a run, again and again until it is done, then another run; what must hold after each.

A moment is drawn in CPU time of the run's processes, not on the clock: another load on the machine does not move it.
"""

from __future__ import annotations

import random
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import whole
from process import Command
from subjects import Subject
from warm import WarmCommand

COLD = 0.2  # so many of the runs start as a user's do; the others are forked from the driver (see `warm`)
WORKERS = 2  # so many workers at most a run loses before it is killed itself


class Campaign:
    """The kills of one subject: the counts, and every fault found as a sentence."""

    def __init__(self, subject: Subject, folder: Path, rng: random.Random, say: Callable[[str], None]) -> None:
        self.subject, self.folder, self.rng, self.say = subject, folder, rng, say
        self.kills: Counter[str] = Counter()
        self.times: dict[bool, tuple[float, float]] = {}
        self.runs = self.rounds = 0
        self.faults: list[str] = []
        self.at: list[float] = []

    def run(self, kills: int, until: float) -> Iterator[dict[str, Any]]:
        """So many kills, or as many as there is time for (seconds of the monotonic clock); what is found, by round.

        Out of time, the last round goes on without kills.
        """
        self.until = until
        self._undisturbed()
        while self.kills.total() < kills and time.monotonic() < until:
            self._round(kills)
            yield self._found()

    def _found(self) -> dict[str, Any]:
        return {
            "scenario": f"kill -9: {self.subject.name}",
            "kills": self.kills.total(),
            "of": dict(self.kills),
            "rounds": self.rounds,
            "runs": self.runs,
            "moments": [round(share, 3) for share in sorted(self.at)],
            "faults": self.faults,
        }

    def _undisturbed(self) -> None:
        """What a run finds that nobody disturbs, and for either start its CPU time: all, and until a part is done."""
        for name, warm in (("compiles", True), ("warm", True), ("cold", False)):
            folder = self.folder / name
            self.subject.prepare(folder)
            command, total, first = self._command(folder, warm), 0.0, 0.0
            while command.running():
                total = max(total, command.cpu())
                if first == 0.0 and self.subject.rows(folder):
                    first = total
                time.sleep(0.05)
            ended = command.ended()
            if ended.code != 0:
                raise SystemExit(f"{self.subject.name} undisturbed: {ended}")
            self.times[warm] = total, first
            self.expected = self.subject.outcome(folder)
        times = ", ".join(f"{total:.1f} ({first:.1f})" for total, first in self.times.values())
        self.say(f"{self.subject.name}: CPU s of a run (to its first part), warm and cold: {times}")

    def _command(self, folder: Path, warm: bool) -> Command:
        self.runs += 1
        return WarmCommand(self.subject.words, folder) if warm else Command(self.subject.words, folder)

    def _round(self, kills: int) -> None:
        """Kill and resume until a run ends by itself; then what it found is what was found undisturbed."""
        self.rounds += 1
        folder = self.folder / f"round{self.rounds}"
        self.subject.prepare(folder)
        seen: dict[Any, Any] = {}
        while True:
            warm = self.rng.random() >= COLD
            command = self._command(folder, warm)
            more = self.kills.total() < kills and time.monotonic() < self.until
            killed = more and self._disturbed(command, folder, len(seen), *self.times[warm])
            ended = None if killed else command.ended()
            self._check(folder, command, seen)
            if ended is not None:
                break
        if ended.code != 0 or ended.traceback:
            self._fault(f"the last run ended with {ended.code}: {ended.err[-300:]}")
        elif self.subject.outcome(folder) != self.expected:
            self._fault("what is found is not what is found undisturbed")
        if left := whole.left_behind(folder):
            self._fault(f"left behind: {left}")

    def _disturbed(self, command: Command, folder: Path, done: int, total: float, first: float) -> bool:
        """Kill what the dice say; False where the run ended before its moment."""
        rest = 1.0 - min(1.0, done / self.subject.parts) if self.subject.store else 1.0
        end = first + (total - first) * rest
        losses = self.rng.randint(0, WORKERS) if self.subject.workers else 0
        spent, rows = 0.0, -1
        for moment in sorted(self.rng.uniform(0.5 * first, end) for _ in range(losses)):
            if not self._at(command, moment, spent):
                return False
            workers, before = command.workers(), rows
            rows = len(self.subject.rows(folder))
            # One loss a task at most: a second one says something of the task, and becomes its row.
            if workers and rows != before:
                command.kill(signal.SIGKILL, self.rng.choice(workers))
                self._count("a worker", moment / end)
                spent += first / 2
        whom = self.rng.choice(("the group", "the parent")) if self.subject.workers else "the group"
        # Half of them while results are written: from the first part on, or in the last quarter.
        low = self.rng.choice((0.0, first if self.subject.store else 0.75 * end))
        moment = self.rng.uniform(low, end)
        if not self._at(command, moment, spent):
            return False
        command.kill(signal.SIGKILL, command.pid if whom == "the parent" else None)
        command.ended()
        self._count(whom, moment / end)
        return True

    def _at(self, command: Command, moment: float, spent: float) -> bool:
        """Wait for a moment, later by what the start of lost workers has taken."""
        return command.until(moment + spent)

    def _count(self, whom: str, share: float) -> None:
        self.kills[whom] += 1
        self.at.append(share)

    def _check(self, folder: Path, command: Command, seen: dict[Any, Any]) -> None:
        """Nothing that was finished is lost or was run again, nothing is half written, no process goes on."""
        if left := command.left():
            self._fault(f"processes go on: {left}")
        for sentence in whole.broken(folder):
            self._fault(f"half written: {sentence}")
        try:
            now = self.subject.rows(folder)
        except Exception as error:
            self._fault(f"the store does not open: {error}")
            return
        for key, row in seen.items():
            if key not in now:
                self._fault(f"lost: {key}")
            elif now[key] != row:
                self._fault(f"run again or changed: {key}")
        seen |= now

    def _fault(self, sentence: str) -> None:
        self.faults.append(sentence)
        self.say(f"{self.subject.name}, round {self.rounds}, kill {self.kills.total()}: {sentence}")
