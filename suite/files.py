"""Files written whole or not at all, also where the process is killed meanwhile."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from suite.errors import InputError

if sys.platform != "win32":
    import fcntl

# What is being written has such a name, in the folder where it will be.
PREFIX, SUFFIX = ".unmodelled-", ".tmp"
# Folders in which this process has looked for what killed ones left behind.
_tidied: set[Path] = set()


def write_whole(path: str | os.PathLike[str], text: str) -> None:
    """Write a text beside its place, then move it there in one step; makes the folder where there is none."""
    with written_whole(path) as beside:
        beside.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """The place beside a file to write it to; it is moved to its own at the end, in one step, or not at all.

    InputError where it cannot be written: a full disk, a folder without the right to write.
    """
    file = Path(path)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        _tidy(file.parent)
        with _held(file.parent) as beside:
            try:
                yield beside
                # A temporary file is private; the result gets the rights that any new file gets.
                mask = os.umask(0)
                os.umask(mask)
                os.chmod(beside, 0o666 & ~mask)
                os.replace(beside, file)
            except BaseException:
                beside.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror or error}); choose another place") from None


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[Path]:
    """A new file that is locked while it is written to: a lock ends with its process, however that ends."""
    while True:
        handle, name = tempfile.mkstemp(prefix=PREFIX, suffix=SUFFIX, dir=folder)
        if sys.platform == "win32":
            # An open file cannot be moved there, and `_tidy` does nothing.
            os.close(handle)
            yield Path(name)
            return
        with os.fdopen(handle, "rb"):
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(handle, fcntl.LOCK_EX)
            # Without a name: another process took it for one that was left behind, just before it was locked.
            if os.fstat(handle).st_nlink:
                yield Path(name)
                return


def _tidy(folder: Path) -> None:
    """Remove what killed processes left behind in a folder: the files that nobody holds."""
    if sys.platform == "win32" or folder in _tidied:
        return
    _tidied.add(folder)
    for left in folder.glob(f"{PREFIX}*{SUFFIX}"):
        with contextlib.suppress(OSError), left.open("rb") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            left.unlink()


def writable_folder(path: Path) -> None:
    """Make the folder, and see that it can be written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except FileExistsError:
        raise InputError(f"{path}: is a file, not a folder; choose another place") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
