"""A command in a process forked from this one, which has imported everything: it starts at once, its workers too.

So a kill at a random moment hits work and writing instead of imports, and costs a tenth. All else is as in a command.
"""

from __future__ import annotations

import importlib
import multiprocessing
import multiprocessing.util
import os
import subprocess
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from process import Command, Ended

MODULES = (
    "benchmark.recovery", "benchmark.table", "fleet.one", "fleet.run", "report.fleet_page", "report.page", "verbs",
)  # fmt: skip


class WarmCommand(Command):
    """`unmodelled` with these words, running in a folder; `before` is code that the process runs first."""

    process: Any

    def __init__(self, words: Sequence[str], folder: Path, before: str = "", environment: Any = None) -> None:
        _import()
        self.out, self.err = self.logs()
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if pid == 0:
            # Not through the driver's frames: the command must end as a process ends.
            os.environ.update(environment or {})
            exec(before, {})
            os._exit(_become(words, folder, self.out, self.err))
        self.process = _Forked(pid)


def run(words: Sequence[str], folder: Path) -> Ended:
    """A command to its end."""
    return WarmCommand(words, folder).ended()


class _Forked:
    """A child as `subprocess.Popen` has it: what is needed here."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.code: int | None = None

    def poll(self) -> int | None:
        """Its exit code, or None while it runs."""
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if pid else None
        return self.code

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, in time."""
        end = time.monotonic() + (timeout or 1e9)
        while (code := self.poll()) is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired("warm", timeout or 0.0)
            time.sleep(0.02)
        return code


def _import() -> None:
    """All that a command imports, and the plug-ins."""
    for name in MODULES:
        importlib.import_module(f"suite.{name}")
    from suite import plugins

    plugins.estimators()
    plugins.cases()
    plugins.effects()


def _become(words: Sequence[str], folder: Path, out: Path, err: Path) -> int:
    """Be the command; its exit code."""
    from suite.__main__ import main

    os.setsid()
    os.chdir(folder)
    for number, path in ((0, Path(os.devnull)), (1, out), (2, err)):
        handle = os.open(path, os.O_RDWR)
        os.dup2(handle, number)
        os.close(handle)
    context = multiprocessing.get_context("fork")
    mock.patch.object(multiprocessing, "get_context", return_value=context).start()
    sys.argv = ["unmodelled", *words]
    try:
        code = main()
    except SystemExit as stopped:
        code = int(stopped.code or 0)
    except BaseException:
        traceback.print_exc()
        code = 1
    multiprocessing.util._exit_function()
    sys.stdout.flush()
    sys.stderr.flush()
    return code
