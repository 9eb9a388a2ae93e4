"""Independent fits side by side: the compiled passes let other threads run, so both of two cores work."""

from __future__ import annotations

import contextvars
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

Item = TypeVar("Item")
Found = TypeVar("Found")


def threads() -> int:
    """How many: $UNMODELLED_THREADS, else the cores that this process may use."""
    named = os.environ.get("UNMODELLED_THREADS", "")
    if named.isdecimal() and int(named) > 0:
        return int(named)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def each(work: Callable[[Item], Found], items: Iterable[Item]) -> list[Found]:
    """`work` of every item, in their order; what one raises is raised here. The results do not depend on the number of
    threads: an item's work must not read what another's writes.
    """
    todo = list(items)
    most = min(threads(), len(todo))
    if most < 2:
        return [work(item) for item in todo]
    pool = ThreadPoolExecutor(most)
    try:
        # numpy's way with overflows is a matter of the context, which a new thread does not inherit.
        waiting = [pool.submit(contextvars.copy_context().run, _call, work, item) for item in todo]
        return [future.result() for future in waiting]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _call(work: Callable[[Any], Any], item: Any) -> Any:
    return work(item)
