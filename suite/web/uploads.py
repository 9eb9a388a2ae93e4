"""Data files that the page sent, in a temporary folder under names of the server's own."""

from __future__ import annotations

import secrets
import shutil
import tempfile
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from suite.web.jobs import RefusedError

KINDS = (".csv", ".parquet", ".mat")
LONGEST = 200  # characters of a name
MOST = 100  # files
ROOM = 2_000_000_000  # bytes of all files together


@dataclass(frozen=True)
class Upload:
    """A data file: the id the page knows it by, the name it is shown under, its place on the disk, its size."""

    id: str
    name: str
    path: Path
    bytes: int

    def to_json(self) -> dict[str, str | int]:
        """What the page is told of it."""
        return {"id": self.id, "name": self.name, "bytes": self.bytes}


class Uploads:
    """The files of one server, gone when it closes."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="unmodelled-"))
        self.known: dict[str, Upload] = {}

    def close(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    async def take(self, name: str, chunks: AsyncIterator[bytes]) -> Upload:
        """Store a body as it streams in; nothing of it is kept where it breaks off or grows too large."""
        kind = checked(name)
        key = secrets.token_hex(8)
        path = self.folder / f"{key}{kind}"
        held = sum(entry.bytes for entry in self.known.values())
        size = 0
        try:
            with path.open("xb") as handle:
                async for chunk in chunks:
                    size += len(chunk)
                    self._room(held + size)
                    handle.write(chunk)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        if not size:
            path.unlink()
            raise RefusedError(f"{name}: the file is empty; expected columns of numbers", status=400)
        return self._keep(Upload(key, name, path, size))

    def given(self, path: Path, name: str | None = None) -> Upload:
        """A file that is already on the disk: named at the start, or written by the server itself."""
        return self._keep(Upload(secrets.token_hex(8), name or path.name, path, path.stat().st_size))

    def drop(self, key: str) -> None:
        """Forget a file, and remove it."""
        entry = self.known.pop(key, None)
        if entry is not None:
            entry.path.unlink(missing_ok=True)

    def find(self, keys: Sequence[str]) -> list[tuple[str, str]]:
        """(path, shown name) of each id."""
        for key in keys:
            if key not in self.known:
                raise RefusedError("these data are no longer here (the server was started anew); open them again")
        return [(str(self.known[key].path), self.known[key].name) for key in keys]

    def _keep(self, entry: Upload) -> Upload:
        self._room(sum(other.bytes for other in self.known.values()))
        self.known[entry.id] = entry
        return entry

    def _room(self, size: int) -> None:
        if size > ROOM or len(self.known) >= MOST:
            raise RefusedError(
                f"the server holds {MOST} files or {ROOM // 10**9} GB at most; start it again to begin anew", status=413
            )


def checked(name: str) -> str:
    """The kind of a file by its name; the name itself is shown and never opened, and must be one that can be shown."""
    if not name or len(name) > LONGEST or not name.isprintable() or "/" in name or "\\" in name:
        shown = name[:40] + ("..." if len(name) > 40 else "")
        raise RefusedError(
            f"{shown!r} is no file name; expected up to {LONGEST} characters without / and \\, such as run1.csv",
            status=400,
        )
    kind = Path(name).suffix.lower()
    if kind not in KINDS:
        raise RefusedError(f"{name}: files {kind or 'without a suffix'} are not read; save it as CSV", status=400)
    return kind
