"""Drive tasks into a store: each outcome is kept in one transaction with the return of its reservation."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from suite.benchmark import cluster, pool
from suite.benchmark.progress import Progress
from suite.benchmark.reservations import Reservations, offered
from suite.benchmark.worker import MEMORY, Task


@dataclass(frozen=True)
class Driving:
    """How tasks are run: in `jobs` processes here or on the Dask cluster at an address; `limit` in seconds and `memory`
    in MiB are of one task; `force` runs again what is stored.
    """

    jobs: int | None = None
    limit: float = 60.0
    memory: float = MEMORY
    force: bool = False
    quiet: bool = False
    dask: str | None = None

    def results(self, tasks: Iterator[Task | None], limit: float) -> Iterator[tuple[Task, Any]]:
        """Each task with its result or Failure, as they finish."""
        if self.dask is None:
            return pool.run(tasks, self.jobs or max(1, os.cpu_count() or 1), limit, self.memory)
        return cluster.run(tasks, self.dask, limit, self.memory)


def drive(
    what: str,
    work: Sequence[tuple[str, Callable[[], Task | None]]],
    held: Reservations,
    how: Driving,
    keep: Callable[[Task, Any], tuple[str, str]],
    limit: float | None = None,
) -> None:
    """Run the tasks that no other run has in hand, each key with what makes its task (see `offered`).

    `keep` stores an outcome, a result or a Failure; it returns the key that is then free, and a name for the progress.
    `limit` in seconds stands in for that of `how`.
    """
    with Progress(what, len(work), quiet=how.quiet) as progress:
        for task, outcome in how.results(offered(work, held), how.limit if limit is None else limit):
            with held.store.transaction():
                key, name = keep(task, outcome)
                held.give_back(key)
            progress.step(name)
