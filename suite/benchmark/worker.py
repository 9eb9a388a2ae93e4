"""One worker process: it answers tasks through a pipe, and is ended when one takes too long or too much memory.

Time and memory are watched from outside, so that they hold in compiled code that never returns to Python.
"""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from suite import plugins
from suite.processes import die_with_parent, interrupts_held

# A process has this long to start, in seconds: it imports the numerics and may compile the kernels.
START = 300.0
# Resident memory of a process in MiB; a worker with numerics and plug-ins imported has 260.
MEMORY = 1024
# How often time and memory are looked at, in seconds: memory is touched at about 1 GiB/s at most.
WATCH = 0.05
# The exit code of a process that another killed, such as the system where memory was short.
KILLED = -9


# What `Worker.look` says of a task that is not done.
RUNNING: Any = object()


@dataclass(frozen=True)
class Task:
    """A call in a worker: "module:function" with arguments that can be pickled, and what the caller knows it by."""

    function: str
    arguments: tuple[Any, ...]
    label: Any = None


@dataclass(frozen=True)
class Failure:
    """What stands in for a result: status "time-out" or "error", and the reason in a sentence."""

    status: str
    reason: str


class Worker:
    """One process, its pipe, the task it has, when that must be done (seconds) and its memory at most (MiB).

    `lost`: it was killed from outside, which says nothing of its task.
    """

    def __init__(self, limit: float, memory: float) -> None:
        self.limit, self.memory = limit, memory
        context = multiprocessing.get_context("spawn")
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=_serve, args=(far,), daemon=True)
        with interrupts_held():
            self.process.start()
        far.close()
        self.task: Task | None = None
        self.ready = False
        self.sound = True
        self.lost = False
        self.at_rest = 0.0
        self.deadline = time.monotonic() + START

    def give(self, task: Task) -> bool:
        """Send a task; False where the process has died at rest. One that still starts answers it afterwards."""
        try:
            self.pipe.send((task.function, task.arguments))
        except OSError:
            return False
        self.task = task
        if self.ready:
            self.deadline = time.monotonic() + self.limit
        return True

    def look(self, answered: bool) -> Any:
        """RUNNING, or the task's result or Failure; then `sound` says if the process can have another task."""
        if answered:
            return self._receive()
        if time.monotonic() >= self.deadline:
            self.sound = False
            return Failure(
                "time-out", f"not done after {self.limit:g} s" if self.ready else "the process did not start"
            )
        if self.resident() > self.memory:
            self.sound = False
            return Failure("error", f"memory: it took more than {self.memory:g} MiB; --memory allows more")
        return RUNNING

    def _receive(self) -> Any:
        try:
            outcome = self.pipe.recv()
        except (EOFError, OSError):
            self.process.join()
            self.sound = False
            self.lost = self.process.exitcode == KILLED
            return Failure("error", f"the process ended with code {self.process.exitcode}")
        except Exception as error:  # an object whose class is not known here
            return Failure("error", f"its result cannot be read: {type(error).__name__}: {error}")
        if not self.ready:
            self.ready, self.at_rest = True, self.resident()
            self.deadline = time.monotonic() + self.limit
            return RUNNING
        # What earlier tasks left behind (machine code of many models) must not count against the next one.
        self.sound = self.resident() < max(self.memory / 2, 1.5 * self.at_rest)
        return outcome

    def resident(self) -> float:
        """Resident memory in MiB; 0 where the system has no /proc: then memory is not watched."""
        try:
            pages = Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]
        except (OSError, IndexError):
            return 0.0
        return int(pages) * os.sysconf("SC_PAGE_SIZE") / 2**20

    def end(self) -> None:
        """Kill the process and wait for its end."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def _serve(pipe: Connection) -> None:
    """The life of a worker: import, say so, then answer tasks until the pipe closes."""
    die_with_parent()
    # What an estimator prints must not mix with the results on standard output.
    with contextlib.suppress(OSError):
        os.dup2(2, 1)
    with contextlib.suppress(KeyboardInterrupt, EOFError, BrokenPipeError, ConnectionResetError):
        # There is a process for each core already.
        os.environ.setdefault("UNMODELLED_THREADS", "1")
        importlib.import_module("suite.benchmark.cells")
        # Not in the first task's time: the plug-ins and their models take seconds to build.
        plugins.estimators()
        plugins.cases()
        pipe.send(None)
        while True:
            function, arguments = pipe.recv()
            module, name = function.split(":")
            try:
                result = getattr(importlib.import_module(module), name)(*arguments)
            except Exception as error:  # the parent turns it into a row
                result = Failure("error", f"{type(error).__name__}: {error}")
            try:
                pipe.send(result)
            except (TypeError, AttributeError, ValueError) as error:
                pipe.send(Failure("error", f"its result cannot be sent: {type(error).__name__}: {error}"))
