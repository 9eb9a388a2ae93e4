"""What a run has in hand: several runs on one store each take cells that no other has.

A run writes its beat into the store every second. What a run without a beat had in hand is free again, so that a killed
run keeps nothing from the next one for longer than SILENT seconds. A beat in the future is none: the clock was set back
after it, and a run that lives beats again within a second.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType

from suite.benchmark.store import Store
from suite.benchmark.worker import Task
from suite.errors import InputError

BEAT, SILENT = 1.0, 6.0
# The runs with a beat, for the number of the value that is the time now.
ALIVE = f"SELECT run FROM runs WHERE abs(beat - ?{{}}) < {SILENT}"


class Reservations:
    """Keys (of cells or tunings) that this run has taken; all are given back at its end."""

    def __init__(self, store: Store) -> None:
        self.store, self.run, self.ended = store, f"{os.getpid()}-{uuid.uuid4().hex[:8]}", threading.Event()

    def __enter__(self) -> Reservations:
        self.store.execute(f"DELETE FROM taken WHERE run NOT IN ({ALIVE.format(1)})", (time.time(),))
        self.store.execute(f"DELETE FROM runs WHERE run NOT IN ({ALIVE.format(1)})", (time.time(),))
        self.store.execute("INSERT INTO runs VALUES (?, ?)", (self.run, time.time()))
        self.thread = threading.Thread(target=self._beat, daemon=True)
        self.thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.ended.set()
        self.thread.join()
        # The error that ended the run is the one to report.
        with contextlib.suppress(*((InputError,) if error else ())):
            self.store.execute("DELETE FROM taken WHERE run = ?", (self.run,))
            self.store.execute("DELETE FROM runs WHERE run = ?", (self.run,))

    def take(self, key: str) -> bool:
        """Take a key; False where another run that is alive has it."""
        done = self.store.execute(
            "INSERT INTO taken VALUES (?1, ?2) ON CONFLICT (key) DO UPDATE SET run = ?2 "
            f"WHERE run = ?2 OR run NOT IN ({ALIVE.format(3)})",
            (key, self.run, time.time()),
        )
        return done.rowcount == 1

    def give_back(self, key: str) -> None:
        """What is done, or need not be done, is free."""
        self.store.execute("DELETE FROM taken WHERE key = ? AND run = ?", (key, self.run))

    def _beat(self) -> None:
        with contextlib.closing(sqlite3.connect(self.store.path, timeout=60.0, isolation_level=None)) as own:
            while not self.ended.wait(BEAT):
                # A disk that is full shows in the next row that is stored.
                with contextlib.suppress(sqlite3.Error):
                    own.execute("INSERT OR REPLACE INTO runs VALUES (?, ?)", (self.run, time.time()))


def offered(work: Iterable[tuple[str, Callable[[], Task | None]]], held: Reservations) -> Iterator[Task | None]:
    """Tasks that no other run has in hand, each taken as it is drawn; None where only another run's are left.

    `work` is each key with what makes its task, which is None where another run has done it meanwhile.
    """
    waiting = deque(work)
    while waiting:
        for _ in range(len(waiting)):
            key, make = waiting.popleft()
            if not held.take(key):
                waiting.append((key, make))
                continue
            task = make()
            if task is None:
                held.give_back(key)
            else:
                yield task
        if waiting:
            yield None
