"""What else happens beside a run: input that vanishes, a second writer, a clock set back, memory that ends."""

from __future__ import annotations

import json
import random
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import whole
from outcome import Outcome
from process import Command
from subjects import SUBJECTS
from warm import WarmCommand, run

# Python's clock, moved by the seconds in a file, in a process and in those that it starts.
CLOCK = """
import os, time
_true = time.time
def _moved():
    try:
        with open(os.environ["MOVED"]) as by:
            return _true() + float(by.read() or 0)
    except (OSError, ValueError):
        return _true()
time.time = _moved
"""
HOUR = 3600.0


def vanishing_input(folder: Path, rng: random.Random) -> Outcome:
    """The data are removed, or cut short, at a random moment: a result of the whole file, a sentence, or its row."""
    found = Outcome("input that vanishes or is cut short")
    for k in range(6):
        work = folder / f"alone{k}"
        SUBJECTS["discover"].prepare(work)
        command = WarmCommand(("compare", "model.toml", "mug0.csv"), work)
        command.until(rng.uniform(0.0, 0.05))
        if k % 2:
            (work / "mug0.csv").unlink()
        else:
            (work / "mug0.csv").write_text("t,T\n0,80\n1,")
        found.check("compare", command.ended(), (0, 2))
    work = folder / "fleet"
    fleet = SUBJECTS["fleet"]
    fleet.prepare(work)
    command = WarmCommand(fleet.words, work)
    while command.running() and not fleet.rows(work):
        time.sleep(0.05)
    stored = {Path(key[0]).name for key in fleet.rows(work)}
    waiting = sorted(path for path in work.glob("mug*.csv") if path.name not in stored)
    for path in waiting[-3:]:
        path.unlink()
    found.check("fleet", command.ended(), (0,), work)
    rows = {Path(key[0]).name: json.loads(row[6]) for key, row in fleet.rows(work).items()}
    found.expect(len(rows) == fleet.parts, f"fleet: {len(rows)} rows")
    for path in waiting[-3:]:
        found.expect("no such file" in rows[path.name]["reason"], f"{path.name}: {rows[path.name]}")
    return found


def two_writers(folder: Path, rng: random.Random) -> Outcome:
    """Two runs at once on a new store, and two discoveries into one folder: all is there, each part once, all whole."""
    found = Outcome("two writers")
    for name in ("bench", "fleet", "discover"):
        subject, work = SUBJECTS[name], folder / name
        subject.prepare(work)
        both = [WarmCommand(subject.words, work) for _ in range(2)]
        seen: dict[object, object] = {}
        while any(command.running() for command in both):
            now = subject.rows(work)
            found.expect(all(now.get(key) == row for key, row in seen.items()), f"{name}: a part was run again")
            seen |= now
            found.faults += [f"{name}: {sentence}" for sentence in whole.broken(work)]
            time.sleep(0.3)
        for command in both:
            found.check(name, command.ended(), (0,), work)
        found.expect(not subject.store or len(subject.rows(work)) == subject.parts, f"{name}: not all is there")
        found.expect(not whole.left_behind(work), f"{name}: {whole.left_behind(work)}")
    return found


def new_stores(folder: Path, rng: random.Random) -> Outcome:
    """Several commands make one new store in the same moment: none is refused."""
    found = Outcome("a store made by several at once")
    SUBJECTS["bench"].prepare(folder)
    for k in range(3):
        words = (
            "bench",
            "run",
            "--plan",
            "plan.toml",
            "--only",
            "generalized-ie default seed=0",
            "--store",
            f"{k}.sqlite",
        )
        for command in [WarmCommand(words, folder) for _ in range(4)]:
            found.check("bench", command.ended(), (0,), folder)
    return found


def clock_set_back(folder: Path, rng: random.Random) -> Outcome:
    """The clock goes back by an hour, and forward again, between and within runs: no run waits for one that is dead."""
    found, subject = Outcome("clock set back"), SUBJECTS["fleet"]
    subject.prepare(folder)
    moved = folder / ".moved"
    moved.write_text("0")
    environment = {"MOVED": str(moved)}
    seen: dict[object, object] = {}
    for back in (-HOUR, -2 * HOUR, HOUR):
        command = WarmCommand(subject.words, folder, CLOCK, environment)
        while command.running() and len(subject.rows(folder)) <= len(seen):
            time.sleep(0.05)
        command.kill(9)
        command.ended()
        now = subject.rows(folder)
        found.expect(all(now.get(key) == row for key, row in seen.items()), "a finished part was run again")
        seen |= now
        moved.write_text(str(back))
    with closing(sqlite3.connect(folder / subject.store)) as connection:
        beats = [beat - time.time() for (beat,) in connection.execute("SELECT beat FROM runs")]
    found.expect(any(abs(beat) > HOUR / 2 for beat in beats), f"the clock was not set: {beats}")
    command = WarmCommand(subject.words, folder, CLOCK, environment)
    time.sleep(1.0)
    moved.write_text(str(-HOUR))
    found.check("the last run", command.ended(300.0), (0,), folder)
    now = subject.rows(folder)
    found.expect(all(now.get(key) == row for key, row in seen.items()), "a finished part was run again")
    found.expect(len(now) == subject.parts, f"{len(now)} of {subject.parts} parts")
    return found


def no_memory(folder: Path, rng: random.Random) -> Outcome:
    """An address space too small for the numerics, and a limit that no worker keeps: a sentence, not a traceback."""
    found = Outcome("out of memory")
    SUBJECTS["fleet"].prepare(folder)
    (folder / "long.csv").write_text("t,T\n" + "".join(f"{k},{80 - 1e-6 * k}\n" for k in range(1_500_000)))
    words = ("compare", "model.toml", "long.csv")
    for mib in (700, 900):
        ended = Command(words, folder, prefix=("prlimit", f"--as={mib * 2**20}")).ended()
        found.check(f"compare in {mib} MiB", ended, (0, 2), folder)
    fleet = (*SUBJECTS["fleet"].words, "--memory", "1")
    found.check("fleet --memory 1", run(fleet, folder), (2,), folder, "--memory")
    return found
