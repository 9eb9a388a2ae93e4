"""Worker processes with limits that hold: a task that hangs, crashes or eats memory never stops the run."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from multiprocessing.connection import wait
from typing import Any

from suite.benchmark.worker import MEMORY, RUNNING, WATCH, Failure, Task, Worker
from suite.errors import InputError

# So many processes in a row that die before they are ready mean that none will.
HOPELESS = 5


def run(tasks: Iterable[Task | None], jobs: int, limit: float, memory: float = MEMORY) -> Iterator[tuple[Task, Any]]:
    """Each task with its result or Failure, as they finish; `limit` in seconds and `memory` in MiB are of one task.

    Tasks are drawn when a worker is free for them; None among them means that there is none now, but there may be. A
    task whose process is killed from outside has a second one.
    """
    source = iter(tasks)
    workers: list[Worker] = []
    again: list[Task] = []
    retried: list[Task] = []
    more, stillborn = True, 0
    try:
        while True:
            idle = [worker for worker in workers if worker.task is None]
            while (more or again) and (idle or len(workers) < jobs):
                task = again.pop() if again else next(source, _END)
                more = more and task is not _END
                if task is None or task is _END:
                    break
                if not idle:
                    workers.append(Worker(limit, memory))
                worker = idle.pop() if idle else workers[-1]
                if not worker.give(task):
                    again.append(task)
                    _bury(worker, workers)
                    # It was killed at rest, or cannot start.
                    stillborn += not worker.ready
                    _hope(stillborn)
            busy = [worker for worker in workers if worker.task is not None]
            if not busy and not more and not again:
                return
            if not busy:
                time.sleep(WATCH)
            answered = set(wait([worker.pipe for worker in busy], timeout=WATCH)) if busy else set()
            for worker in busy:
                outcome = worker.look(worker.pipe in answered)
                stillborn = 0 if worker.ready else stillborn
                if outcome is RUNNING:
                    continue
                task, worker.task = worker.task, None
                assert task is not None
                if not worker.sound:
                    _bury(worker, workers)
                if worker.ready and worker.lost and not any(task is one for one in retried):
                    retried.append(task)
                    again.append(task)
                elif worker.ready:
                    yield task, outcome
                else:
                    again.append(task)
                    stillborn += 1
                    _hope(stillborn, outcome)
    finally:
        for worker in workers:
            worker.end()


class Hand:
    """One process that answers one task after the other, kept between them."""

    def __init__(self) -> None:
        self.worker: Worker | None = None

    def answer(self, task: Task, limit: float, memory: float) -> Any:
        """The task's result or Failure; as in `run` it has a second process."""
        outcome, lost = None, False
        for _ in range(HOPELESS):
            worker = self.worker = self.worker or Worker(limit, memory)
            worker.limit, worker.memory = limit, memory
            given, outcome = worker.give(task), RUNNING
            while given and outcome is RUNNING:
                outcome = worker.look(bool(wait([worker.pipe], timeout=WATCH)))
            worker.task = None
            if not (given and worker.sound):
                worker.end()
                self.worker = None
            if given and worker.ready and (lost or not worker.lost):
                return outcome
            lost |= worker.lost
        _hope(HOPELESS, outcome)
        raise AssertionError


_END: Any = object()


def _bury(worker: Worker, workers: list[Worker]) -> None:
    worker.end()
    workers.remove(worker)


def _hope(stillborn: int, outcome: Any = None) -> None:
    if stillborn >= HOPELESS:
        said = outcome.reason if isinstance(outcome, Failure) else "they end at once"
        raise InputError(f"no worker process can start ({said}); is there memory for them? see --memory and --jobs")
