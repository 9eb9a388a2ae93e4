"""Files written whole or not at all, also where the process is killed meanwhile."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from suite.errors import InputError


def write_whole(path: str | os.PathLike[str], text: str) -> None:
    """Write a text beside its place, then move it there in one step; makes the folder where there is none."""
    with written_whole(path) as beside:
        beside.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """The place beside a file to write it to; it is moved to its own at the end, in one step, or not at all."""
    file = Path(path)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(suffix=".tmp", dir=file.parent)
        os.close(handle)
        try:
            yield Path(name)
            # A temporary file is private; the result gets the rights that any new file gets.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(name, 0o666 & ~mask)
            os.replace(name, file)
        except BaseException:
            os.unlink(name)
            raise
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror}); choose another place") from None


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
