"""What one server holds while it runs: its secrets, its processes, the data files, the analyses."""

from __future__ import annotations

import asyncio
import secrets
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from suite.web.jobs import Crew, RefusedError
from suite.web.uploads import Uploads

ANALYSES = 100  # the oldest is forgotten first


@dataclass
class Desk:
    """The text `model` and the files `data` were named at the start, `store` holds results of the benchmark."""

    port: int
    model: str | None = None
    data: Sequence[Path] = ()
    store: Path | None = None
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    crew: Crew = field(default_factory=Crew)
    uploads: Uploads = field(default_factory=Uploads)
    analyses: OrderedDict[str, bytes] = field(default_factory=OrderedDict)
    examples: asyncio.Task[str] | None = None
    loaded: dict[str, object] | None = None
    # One simulation at a time: all go to the process that has the model ready.
    sliding: asyncio.Lock = field(default_factory=asyncio.Lock)

    @property
    def cookie(self) -> str:
        """The cookie's name: cookies are shared between the ports of a host, so it holds the port."""
        return f"unmodelled-{self.port}"

    @property
    def url(self) -> str:
        """The address that opens the page."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    def open(self) -> None:
        """Start the processes, and take up the files named at the start."""
        self.crew.start()
        # Loading the cases takes seconds: begun before the page asks for it.
        self.examples = asyncio.ensure_future(self.crew.call("examples"))
        # Nobody may ask before the server is stopped; its failure is then no news.
        self.examples.add_done_callback(lambda task: task.cancelled() or task.exception())
        if self.model is not None:
            data = [self.uploads.given(path).to_json() for path in self.data]
            self.loaded = {"model": self.model, "data": data}

    def close(self) -> None:
        """End the processes, remove the temporary files."""
        if self.examples is not None:
            self.examples.cancel()
        self.crew.close()
        self.uploads.close()

    def keep(self, key: str, blob: bytes) -> None:
        """Hold an analysis for a report."""
        self.analyses[key] = blob
        while len(self.analyses) > ANALYSES:
            self.analyses.popitem(last=False)

    def kept(self, keys: Sequence[str]) -> list[bytes]:
        """Analyses by their ids."""
        for key in keys:
            if key not in self.analyses:
                raise RefusedError("an analysis is no longer here (the server was started anew); analyse again")
        return [self.analyses[key] for key in keys]
