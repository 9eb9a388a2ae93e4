"""Signals at random moments of every long verb: an interrupt at the terminal, and what ends a service or a session."""

from __future__ import annotations

import random
import signal
from collections.abc import Sequence
from pathlib import Path

import whole
from outcome import Outcome
from process import Command
from subjects import SUBJECTS
from warm import WarmCommand, run

VERBS: dict[str, Sequence[str]] = {
    "compare": ("compare", "model.toml", "mug0.csv", "--refit"),
    "diagnose": ("diagnose", "model.toml", "mug0.csv"),
    "discover": ("discover", "model.toml", "mug0.csv", "-o", "out-discover"),
    "fleet": ("diagnose", "model.toml", "mug*.csv", "--each", "-o", "out-fleet", "--jobs", "1"),
    "example": ("example", "paper", "out-example"),
    "watch": ("watch", "model.toml", "mug0.csv", "--json"),
    "serve": ("serve", "--no-browser", "--port", "0"),
    "bench run": ("bench", "run", "--plan", "plan.toml", "--store", "out.sqlite", "--jobs", "1", "--force"),
    "bench report": ("bench", "report", "--store", "ok.sqlite", "-o", "out-report"),
    "bench plot": ("bench", "plot", "--store", "ok.sqlite", "-o", "out-plot"),
}
SERVED = 3.0  # CPU seconds of `serve`, which has no end of its own
START = 3.0  # CPU seconds of the imports
SIGNALS = (signal.SIGINT, signal.SIGINT, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# An interrupt comes to the group, as from a terminal; the others to the command, as from a service manager.
TO_GROUP = (signal.SIGINT, signal.SIGHUP)


def stops(folder: Path, rng: random.Random, times: int = 4) -> Outcome:
    """Each verb so many times: its exit code is 128 + the signal, no traceback, no half-written file, no process left.

    So early that Python is not ready, or in the last moment, the signal itself ends the process, without a word.
    """
    found = Outcome("SIGINT, SIGTERM, SIGHUP at random moments")
    SUBJECTS["fleet"].prepare(folder)
    made = run(("bench", "run", "--plan", "plan.toml", "--store", "ok.sqlite", "--jobs", "1"), folder)
    found.check("bench run", made, (0,), folder)
    for verb, words in VERBS.items():
        total = _total(verb, words, folder)
        for k in range(times):
            # The first one as a user starts it: most of its time are imports.
            command, start = (WarmCommand(words, folder), 0.0) if k else (Command(words, folder), START)
            _stop(found, verb, command, folder, rng.choice(SIGNALS), rng.uniform(0.0, start + total))
    for verb, words in VERBS.items():
        if verb not in ("serve", "bench run"):
            found.check(f"{verb} afterwards", run(words, folder), (0,), folder)
    if left := whole.left_behind(folder):
        found.faults.append(f"left behind: {left}")
    return found


def _total(verb: str, words: Sequence[str], folder: Path) -> float:
    """CPU seconds of the verb undisturbed."""
    if verb == "serve":
        return SERVED
    command, total = WarmCommand(words, folder), 0.0
    while command.running():
        total = max(total, command.cpu())
        command.wait(0.05)
    command.ended()
    return total


def _stop(found: Outcome, verb: str, command: Command, folder: Path, number: int, moment: float) -> None:
    if not command.until(moment):
        command.ended()
        return
    command.kill(number, None if number in TO_GROUP else command.pid)
    ended = command.ended(120.0)
    what = f"{verb}, {signal.Signals(number).name} after {moment:.2f} CPU s"
    codes = {128 + number, -number, 0}
    said = ended.err.strip().splitlines()[-1:]
    if ended.traceback and _of_python(ended.err) and not ended.out:
        # Before the first line of ours Python itself answers.
        found.tried += 1
        found.codes["before our first line"] = found.codes.get("before our first line", 0) + 1
        return
    found.check(what, ended, codes, folder)
    if ended.code == 128 + signal.SIGINT:
        found.expect(said == ["unmodelled: stopped; what was finished is kept"], f"{what}: {ended.err[-300:]!r}")
    if left := command.left():
        found.faults.append(f"{what}: processes go on: {left}")


def _of_python(said: str) -> bool:
    """Whether an interrupt met the interpreter's own start, or that of `runpy`, which are not ours to change."""
    return "KeyboardInterrupt" in said and "/suite/" not in said
