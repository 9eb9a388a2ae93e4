"""The same tasks on an existing Dask cluster (Slurm, Kubernetes, cloud by dask-jobqueue and friends).

Each thread of a Dask worker runs its tasks in a process of its own, so that the limits of a cell hold there as here. A
lost Dask worker's tasks run again on another, by Dask; one that is lost with its worker again and again is an error.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import multiprocessing
import queue
import sys
import threading
import time
import uuid
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import suite
from suite.benchmark import pool
from suite.benchmark.worker import WATCH, Failure, Task
from suite.errors import InputError

# Tasks sent per thread of the cluster: one to run and one to follow it at once.
AHEAD = 2
# How often the cluster is asked for its size, in seconds.
ASK = 1.0
CONNECT = 10.0
PACKAGES = ("suite", "estimators", "baselines", "cases", "effects")


def run(tasks: Iterable[Task | None], address: str, limit: float, memory: float) -> Iterator[tuple[Task, Any]]:
    """Each task with its result or Failure, as they finish, from the cluster whose scheduler is at the address.

    InputError where it cannot be reached, is lost, or has another version of something that results depend on.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--dask needs the package distributed; install unmodelled[dask]") from None
    try:
        client = Client(address, timeout=CONNECT)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"no Dask scheduler answers at {address} ({error}); start one, or mend --dask") from None
    with client:
        _check(client, address)
        yield from _results(client, address, tasks, limit, memory)


def _check(client: Any, address: str) -> None:
    """Refuse a cluster that would not compute what this process does."""
    try:
        found = client.run(fingerprint)
    except Exception as error:
        raise InputError(
            f"a Dask worker at {address} cannot run unmodelled ({type(error).__name__}: {error}); install it there"
        ) from None
    if not found:
        raise InputError(f"the Dask cluster at {address} has no worker; start one")
    ours = fingerprint()
    for name, theirs in sorted(found.items()):
        _refuse(name, theirs, ours)


def _refuse(worker: str, theirs: dict[str, str], ours: dict[str, str]) -> None:
    other = [f"{name} {theirs[name]} instead of {ours[name]}" for name in ours if theirs.get(name) != ours[name]]
    if other:
        raise InputError(f"Dask worker {worker} has {', '.join(other)}; install the same there")


def _results(
    client: Any, address: str, tasks: Iterable[Task | None], limit: float, memory: float
) -> Iterator[tuple[Task, Any]]:
    """Keep every thread of the cluster, as large as it is now, supplied; hand over what is finished."""
    source, ours, run_name = iter(tasks), fingerprint(), uuid.uuid4().hex[:8]
    sent: dict[Any, Task] = {}
    done: queue.SimpleQueue[Any] = queue.SimpleQueue()
    more, count, threads, asked = True, 0, 1, -math.inf
    try:
        while more or sent:
            if more and time.monotonic() > asked + ASK:
                threads, asked = max(1, sum(client.nthreads().values())), time.monotonic()
            while more and len(sent) < AHEAD * threads:
                task = next(source, _END)
                more = task is not _END
                if task is None or task is _END:
                    break
                count += 1
                key = f"cell-{run_name}-{count}"
                future = client.submit(answer, task, limit, memory, ours, key=key, pure=False)
                sent[future] = task
                future.add_done_callback(done.put)
            for future, outcome in _outcomes(client, _finished(done), address):
                future.release()
                yield sent.pop(future), outcome
    finally:
        with contextlib.suppress(Exception):
            client.cancel(list(sent), force=True)


_END: Any = object()


def _finished(done: queue.SimpleQueue[Any]) -> list[Any]:
    """All that has finished by now, after a moment's waiting for the first."""
    found = []
    with contextlib.suppress(queue.Empty):
        found.append(done.get(timeout=WATCH))
        while True:
            found.append(done.get_nowait())
    return found


def _outcomes(client: Any, futures: list[Any], address: str) -> Iterator[tuple[Any, Any]]:
    """Each future with its task's result, or a Failure where the task took its workers with it."""
    # One request for all: alone, each would cost more than the rest of a task's way.
    ready = [future for future in futures if future.status == "finished"]
    results = dict(zip(ready, client.gather(ready), strict=True))
    for future in futures:
        yield future, results[future] if future in results else _outcome(future, address)


def _outcome(future: Any, address: str) -> Any:
    """The Failure of what did not end well; the result of what had ended when its worker was lost, and ran again."""
    from distributed import KilledWorker

    if future.status == "cancelled" or future.status == "lost":
        raise InputError(f"the Dask cluster at {address} is lost; what was finished is kept, run again to go on")
    error = future.exception()
    if isinstance(error, KilledWorker):
        return Failure("error", "every Dask worker that ran it was lost, until Dask gave up")
    if isinstance(error, InputError):
        raise error
    return future.result() if error is None else Failure("error", f"{type(error).__name__}: {error}")


_own = threading.local()


def answer(task: Task, limit: float, memory: float, expected: dict[str, str]) -> Any:
    """In a thread of a Dask worker: the task's result from a process of this thread's own."""
    if fingerprint() != expected:  # a worker that has joined since the start
        from distributed import get_worker

        _refuse(get_worker().address, fingerprint(), expected)
    # Dask marks its workers as daemons, which may have no children since these would outlive them; ours end with them.
    config: dict[str, Any] = vars(multiprocessing.current_process()).get("_config", {})
    config["daemon"] = False
    if getattr(_own, "hand", None) is None:
        _own.hand = pool.Hand()
    return _own.hand.answer(task, limit, memory)


@cache
def fingerprint() -> dict[str, str]:
    """What results depend on, by name: versions, and a hash of the source of the package's own files."""
    root = Path(suite.__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    packages = {name: version(name) for name in ("numpy", "scipy", "numba", "filterpy", "distributed")}
    python = ".".join(map(str, sys.version_info[:2]))
    return {"unmodelled": f"{suite.__version__} (source {digest.hexdigest()[:8]})", "python": python, **packages}
