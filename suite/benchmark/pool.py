"""Worker processes with time-outs that hold: a task that hangs or crashes costs its process, never the run."""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

# A process has this long to start: it imports the numerics and may compile the kernels.
START = 300.0


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


class _Worker:
    """One process, its pipe, the task it has and when that must be done."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=_serve, args=(far,), daemon=True)
        self.process.start()
        far.close()
        self.task: Task | None = None
        self.ready = False
        self.deadline = time.monotonic() + START

    def give(self, task: Task, limit: float) -> None:
        self.task, self.deadline = task, time.monotonic() + limit
        self.pipe.send((task.function, task.arguments))

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def _serve(pipe: Connection) -> None:
    """The life of a worker: import, say so, then answer tasks until the pipe closes."""
    threading.Thread(target=_die_with_parent, daemon=True).start()
    # An interrupt at the keyboard is the parent's to handle; it ends its workers.
    with contextlib.suppress(KeyboardInterrupt, EOFError, BrokenPipeError):
        importlib.import_module("suite.benchmark.cells")
        pipe.send(None)
        while True:
            function, arguments = pipe.recv()
            module, name = function.split(":")
            try:
                result = getattr(importlib.import_module(module), name)(*arguments)
            except Exception as error:  # the parent turns it into a row
                result = Failure("error", f"{type(error).__name__}: {error}")
            pipe.send(result)


def _die_with_parent() -> None:
    """A worker whose parent was killed must not go on computing."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def run(tasks: Iterable[Task], jobs: int, limit: float) -> Iterator[tuple[Task, Any]]:
    """Each task with its result or Failure, as they finish; `limit` is the time-out of one task in seconds."""
    todo = list(tasks)[::-1]
    workers = [_Worker() for _ in range(min(jobs, len(todo)))]
    try:
        while todo or any(worker.task for worker in workers):
            for worker in workers:
                if worker.ready and worker.task is None and todo:
                    worker.give(todo.pop(), limit)
            busy = [worker for worker in workers if worker.task is not None or not worker.ready]
            patience = max(0.0, min(worker.deadline for worker in busy) - time.monotonic())
            answered = set(wait([worker.pipe for worker in busy], timeout=patience))
            for worker in busy:
                if worker.pipe in answered:
                    outcome = _receive(worker)
                elif time.monotonic() >= worker.deadline:
                    outcome = Failure("time-out", f"not done after {limit:g} s")
                else:
                    continue
                task, worker.task = worker.task, None
                if (isinstance(outcome, Failure) and outcome.status != "error") or not worker.process.is_alive():
                    worker.end()
                    workers[workers.index(worker)] = _Worker()
                    if task is None:
                        raise RuntimeError(f"a worker process could not start: {outcome}")
                if task is None:
                    worker.ready = True
                else:
                    yield task, outcome
    finally:
        for worker in workers:
            worker.end()


def _receive(worker: _Worker) -> Any:
    """The answer of a worker, or a Failure where it died."""
    try:
        return worker.pipe.recv()
    except (EOFError, OSError):
        worker.process.join()
        return Failure("died", f"the process ended with code {worker.process.exitcode}")
