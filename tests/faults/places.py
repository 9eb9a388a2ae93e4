"""Places that fail: a small disk, a folder that cannot be written, a user without rights or home."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

# A user that is not root and has no entry: modes of files hold for it, and it has no home.
NOBODY = ("unshare", "--map-user=12345")


class UnableError(Exception):
    """A fault that this machine does not let us make, with the reason."""


@contextlib.contextmanager
def small_disk(place: Path, kib: int) -> Iterator[Path]:
    """A file system of so many KiB."""
    place.mkdir(parents=True, exist_ok=True)
    _do("mount", "-t", "tmpfs", "-o", f"size={kib}k", "tmpfs", str(place))
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=False)


def resize(place: Path, kib: int) -> None:
    """Give it room, or take it."""
    _do("mount", "-o", f"remount,size={kib}k", str(place))


def fill(place: Path) -> Path:
    """A file that takes all that is left."""
    path = place / ".filling"
    with contextlib.suppress(OSError), path.open("wb", buffering=0) as handle:
        while True:
            handle.write(b"x" * 4096)
    return path


@contextlib.contextmanager
def read_only(place: Path) -> Iterator[Sequence[str]]:
    """Make a folder one that cannot be written; what is yielded goes in front of a command, for whom it holds."""
    before = place.stat().st_mode
    place.chmod(0o555)
    try:
        yield unprivileged()
    finally:
        place.chmod(before)


def unprivileged() -> Sequence[str]:
    """What goes in front of a command so that modes hold: nothing for a user, another identity for root."""
    if os.geteuid() != 0:
        return ()
    _do(*NOBODY, "true")
    return NOBODY


def _do(*command: str) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise UnableError(f"{command[0]}: {error.strerror}") from None
    if done.returncode:
        raise UnableError(f"{' '.join(command[:3])}: {done.stderr.strip()[:120]}")
