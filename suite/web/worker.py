"""A computing process of the server: it answers tasks one after the other, and says what it is at meanwhile."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
import warnings
from multiprocessing.connection import Connection
from typing import Any

from suite.errors import InputError
from suite.processes import die_with_parent

MORTAL, WARM = "suite.web.mortal", "suite.web.warm"

# What a process says: that it has started, what it is at, the answer, that the input is bad, that it failed itself.
READY, TOLD, DONE, REFUSED, FAILED = "ready", "told", "done", "refused", "failed"


def serve(pipe: Connection) -> None:
    """The life of a process: import, say so, then answer tasks until the pipe closes.

    A task is (name of a function of `tasks`, arguments); the function also gets `tell`, which sends a sentence.
    """
    die_with_parent()
    # What a plug-in prints must not mix with the server's own line on standard output.
    with contextlib.suppress(OSError):
        os.dup2(2, 1)
    warnings.simplefilter("ignore")
    with contextlib.suppress(KeyboardInterrupt, EOFError, BrokenPipeError, ConnectionResetError):
        tasks = importlib.import_module(WARM).tasks
        pipe.send((READY, None))
        while True:
            name, arguments = pipe.recv()
            pipe.send(_answer(getattr(tasks, name), arguments, pipe))


def _answer(function: Any, arguments: tuple[Any, ...], pipe: Connection) -> tuple[str, Any]:
    try:
        return DONE, function(*arguments, tell=lambda text: pipe.send((TOLD, text)))
    except InputError as error:
        return REFUSED, (str(error), getattr(error, "line", None))
    except MemoryError:
        return REFUSED, ("the memory of this machine does not suffice for these data; take a part of them", None)
    except Exception as error:  # the server goes on whatever a model or a plug-in does
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        place = f"{os.path.basename(frame.tb_frame.f_code.co_filename)}:{frame.tb_lineno}" if frame else "unknown"
        print(f"unmodelled: {function.__name__} failed at {place}: {type(error).__name__}: {error}", file=sys.stderr)
        return FAILED, f"This is a defect of unmodelled, not of your files: {type(error).__name__}: {error} ({place})"
