"""Files written whole or not at all, also where the process is killed meanwhile."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from suite.errors import InputError


def write_whole(path: str | os.PathLike[str], text: str) -> None:
    """Write a text beside its place, then move it there in one step; makes the folder where there is none."""
    file = Path(path)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, suffix=".tmp", delete=False, encoding="utf-8") as handle:
            handle.write(text)
        try:
            # A temporary file is private; the result gets the rights that any new file gets.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(handle.name, 0o666 & ~mask)
            os.replace(handle.name, file)
        except BaseException:
            os.unlink(handle.name)
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
