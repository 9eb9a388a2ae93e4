"""A command in a process group of its own: started, watched by the CPU time it takes, killed whole or in part."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

TICK = os.sysconf("SC_CLK_TCK")
POLL = 0.03  # seconds between looks at a running group at least
CORES = float(os.cpu_count() or 1)  # CPU seconds that a group can take in a second
GONE = 20.0  # seconds in which every process of a killed command must have ended
PATIENCE = 900.0  # seconds after which a command counts as hung


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit code (minus the signal that killed it) and what it wrote."""

    code: int
    out: str
    err: str

    @property
    def traceback(self) -> bool:
        """Whether Python's own words of an error are in what it wrote."""
        return any(word in self.err + self.out for word in ("Traceback", "Exception ignored", "Fatal Python"))


class Command:
    """`unmodelled` with these words, running in a folder."""

    def __init__(
        self,
        words: Sequence[str],
        folder: Path,
        environment: Mapping[str, str] | None = None,
        prefix: Sequence[str] = (),
        **streams: int,
    ) -> None:
        self.out, self.err = self.logs()
        inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
        with self.out.open("wb") as out, self.err.open("wb") as err:
            self.process = subprocess.Popen(
                [*prefix, sys.executable, "-m", "suite", *words], cwd=folder, start_new_session=True,
                env={**inherited, **(environment or {})}, stdin=subprocess.DEVNULL,
                stdout=streams.get("stdout", out), stderr=streams.get("stderr", err),
            )  # fmt: skip

    @staticmethod
    def logs() -> tuple[Path, Path]:
        """Files for what it writes; not in its folder, whose disk may be full."""
        paths = []
        for ending in (".out", ".err"):
            handle, name = tempfile.mkstemp(suffix=ending)
            os.close(handle)
            paths.append(Path(name))
        return paths[0], paths[1]

    @property
    def pid(self) -> int:
        """The process, which is the group too."""
        return self.process.pid

    def running(self) -> bool:
        """Whether the command itself has not ended."""
        return self.process.poll() is None

    def wait(self, seconds: float) -> None:
        """Wait for its end, so long at most."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(seconds)

    def workers(self) -> list[int]:
        """The processes of the group that it started to compute."""
        return [pid for pid, _ in _members(self.pid) if pid != self.pid and "tracker" not in _command_line(pid)]

    def cpu(self) -> float:
        """CPU seconds of the command and what it has started, and of the ended that they have waited for."""
        found, todo = 0.0, [self.pid]
        while todo:
            pid = todo.pop()
            with contextlib.suppress(OSError, IndexError):
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                found += sum(map(int, fields[11:15])) / TICK
                for children in Path(f"/proc/{pid}/task").glob("*/children"):
                    todo += map(int, children.read_text().split())
        return found

    def until(self, cpu: float) -> bool:
        """Wait until the group has taken so much CPU time; False where the command ended before."""
        while self.running():
            left = cpu - self.cpu()
            if left <= 0.0:
                return True
            # Sooner it cannot be: the driver must not take the time that it measures.
            time.sleep(max(POLL, left / CORES))
        return False

    def kill(self, number: int, pid: int | None = None) -> None:
        """Send a signal to one process, or to the whole group."""
        with contextlib.suppress(ProcessLookupError):
            if pid is None:
                os.killpg(self.pid, number)
            else:
                os.kill(pid, number)

    def ended(self, patience: float = PATIENCE) -> Ended:
        """Wait for its end; a command that hangs is killed and has the code -SIGALRM."""
        try:
            code = self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.kill(signal.SIGKILL)
            self.process.wait()
            code = -signal.SIGALRM
        done = Ended(code, self.out.read_text(errors="replace"), self.err.read_text(errors="replace"))
        self.out.unlink()
        self.err.unlink()
        return done

    def left(self) -> list[str]:
        """The processes of the group that outlive the command; they are killed."""
        give_up = time.monotonic() + GONE
        while (members := [pid for pid, _ in _members(self.pid)]) and time.monotonic() < give_up:
            time.sleep(10 * POLL)
        names = [_command_line(pid) for pid in members]
        for pid in members:
            self.kill(signal.SIGKILL, pid)
        return names


def run(words: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None) -> Ended:
    """A command to its end."""
    return Command(words, folder, environment).ended()


def _members(group: int) -> Iterator[tuple[int, float]]:
    """Processes of a group with their CPU seconds; the dead that nobody has waited for are left out."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal():
            continue
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == group and fields[0] not in "ZX":
            yield int(entry.name), sum(map(int, fields[11:15])) / TICK


def _command_line(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
    except OSError:
        return ""
