"""What a reader may do with any input: return, or raise InputError with one sentence; within bounds; nothing else.

The bounds are those of one call: processor time, memory, files. A call that evaluates text would touch a tripwire.
"""

from __future__ import annotations

import builtins
import contextlib
import faulthandler
import os
import resource
import signal
import sys
import sysconfig
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from suite.errors import LONGEST, InputError

SECONDS = 1.0  # of processor time
MEMORY = 400_000  # KiB by which one call may raise the process's peak
LIMIT = 6 * 2**30  # bytes of address space: above it MemoryError, so that a bomb ends the call and not the machine
PATIENCE = 15  # seconds of processor time, after which a call is broken off
WAIT = 600  # seconds of the clock, after which the process is ended: on a busy machine they are long
CANARY = "fuzz_canary"
# Loading Python's own modules on the way is no access to a file that somebody named.
HOMES = tuple(
    str(Path(place).resolve())
    for place in (sys.prefix, sys.base_prefix, sysconfig.get_path("stdlib"), Path(__file__).parents[2])
)
SYSTEM = ("/proc/", "/sys/", "/dev/null", "/dev/urandom", "/etc/localtime", "/usr/share/zoneinfo")
FORBIDDEN = (
    "os.system", "os.exec", "os.fork", "os.posix_spawn", "os.spawn", "os.remove", "os.rename", "os.rmdir", "os.mkdir",
    "os.link", "os.symlink", "os.truncate", "os.putenv", "shutil.", "socket.connect", "socket.bind", "subprocess.Popen",
    "webbrowser.open", "code.__new__", "ctypes.dlopen",
)  # fmt: skip


class TooLongError(BaseException):
    """The call was broken off; no reader catches it."""


class Tripwire:
    """Reachable from evaluated text only: whatever is done with it is noted."""

    touched = False

    def _touch(self, *_: Any, **__: Any) -> Any:
        Tripwire.touched = True
        return self

    __call__ = __getattr__ = __getitem__ = __add__ = __radd__ = __mul__ = __rmul__ = __neg__ = __pow__ = _touch


@dataclass
class Finding:
    """A defect: what was wrong, the shortest input that showed it, and how often."""

    what: str
    given: str
    detail: str
    count: int = 1


@dataclass
class Oracle:
    """Calls readers, and counts what they did."""

    target: str
    tried: int = 0
    answers: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    findings: dict[str, Finding] = field(default_factory=dict)
    at_end: list[Callable[[], None]] = field(default_factory=list)
    _armed: bool = False
    _allowed: tuple[str, ...] = ()
    _seen: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        setattr(builtins, CANARY, Tripwire())
        resource.setrlimit(resource.RLIMIT_AS, (LIMIT, resource.RLIM_INFINITY))
        sys.addaudithook(self._audit)
        signal.signal(signal.SIGPROF, _broken_off)

    def _audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._armed:
            return
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path = os.path.realpath(os.fsdecode(arguments[0]))
            inside = path in self._allowed or path.startswith((*HOMES, *SYSTEM))
            if not inside or (_writes(arguments) and path not in self._allowed):
                self._seen.append(f"opened {path}")
        elif event == "import" and str(arguments[0]).startswith(CANARY):
            self._seen.append(f"imported {arguments[0]}")
        elif event.startswith(FORBIDDEN):
            self._seen.append(f"{event} {arguments!r:.80}")

    @contextlib.contextmanager
    def _watched(self, allowed: tuple[Path, ...]) -> Iterator[None]:
        self._allowed, self._seen = tuple(os.path.realpath(path) for path in allowed), []
        Tripwire.touched = False
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)
        # Where C code does not return to Python, the alarm is not heard; nor is it where nothing is computed.
        faulthandler.dump_traceback_later(WAIT, exit=True)
        self._armed = True
        try:
            yield
        finally:
            self._armed = False
            signal.setitimer(signal.ITIMER_PROF, 0)
            faulthandler.cancel_dump_traceback_later()

    def check(self, call: Callable[[], Any], given: str | bytes, *allowed: Path) -> Any:
        """What the call returned, or None where it refused; every breach of the bounds is noted."""
        self.tried += 1
        memory, began = _peak(), time.process_time()
        result, answer = None, "accepted"
        try:
            with self._watched(allowed):
                result = call()
        except InputError as error:
            answer = "refused"
            self._sentence(str(error), given)
        except TooLongError:
            answer = "broken off"
            self.note(f"broken off after {PATIENCE} s", given, "")
        except Exception as error:  # the very thing that is looked for
            answer = "failed"
            frame = traceback.extract_tb(error.__traceback__)[-1]
            own = [f for f in traceback.extract_tb(error.__traceback__) if "/suite/" in f.filename]
            at = f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else frame.name
            self.note(f"{type(error).__name__} at {at}", given, str(error)[:200])
        spent, grown = time.process_time() - began, _peak() - memory
        self.answers[answer] += 1
        self.slowest = max(self.slowest, spent)
        if spent > SECONDS:
            self.note("more than 1 s of processor time", given, f"{spent:.1f} s")
        if grown > MEMORY:
            self.note("memory", given, f"{grown // 1024} MiB more")
        if Tripwire.touched:
            self.note("text was evaluated", given, "")
        for seen in self._seen:
            self.note(f"touched something: {seen.partition(' ')[0]}", given, seen)
        return result

    def _sentence(self, said: str, given: str | bytes) -> None:
        if not said.isprintable():
            self.note("a sentence with control characters", given, repr(said)[:300])
        if len(said) > LONGEST:
            self.note("a sentence too long", given, f"{len(said)} characters: {said[:300]}")
        if "Traceback (" in said or "object at 0x" in said:
            self.note("a sentence with the insides of Python", given, said[:300])

    def note(self, what: str, given: str | bytes, detail: str) -> None:
        """Keep the shortest input of each kind of defect."""
        shown = given if isinstance(given, str) else repr(given)
        known = self.findings.get(what)
        if known is None:
            self.findings[what] = Finding(what, shown, detail)
            return
        known.count += 1
        if len(shown) < len(known.given):
            known.given, known.detail = shown, detail

    def to_json(self) -> dict[str, Any]:
        """Counts and defects."""
        return {
            "target": self.target, "tried": self.tried, **self.answers, "slowest_s": round(self.slowest, 3),
            "defects": [vars(finding) | {"given": finding.given[:2000]} for finding in self.findings.values()],
        }  # fmt: skip


def _broken_off(_: int, __: FrameType | None) -> None:
    raise TooLongError


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _writes(arguments: tuple[Any, ...]) -> bool:
    mode, flags = arguments[1], arguments[2]
    return bool(set(mode or "") & set("wax+")) or bool(flags & (os.O_WRONLY | os.O_RDWR))
