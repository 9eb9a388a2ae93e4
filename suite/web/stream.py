"""An answer a line at a time, while something is computed; when the listener leaves, the work is ended at once."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Awaitable, Callable

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from suite.web.jobs import RefusedError

BEAT = 1.0  # seconds between two lines at most

# Given a function that takes a sentence on what is being done, the JSON text of the result.
Work = Callable[[Callable[[str], None]], Awaitable[str]]


class Lines(Response):
    """NDJSON: {"progress", "seconds"} at least once a second, then {"result"} or {"error", "line"}."""

    media_type = "application/x-ndjson"

    def __init__(self, work: Work) -> None:
        super().__init__()
        self.work = work
        # The length is not known before the end.
        del self.headers["content-length"]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
        began = time.monotonic()
        said: asyncio.Queue[str] = asyncio.Queue()

        async def line(body: str, more: bool = True) -> None:
            await send({"type": "http.response.body", "body": body.encode() + b"\n", "more_body": more})

        async def tell() -> None:
            now = "Waiting for a free process"
            while True:
                seconds = round(time.monotonic() - began, 1)
                await line(json.dumps({"progress": now, "seconds": seconds}, ensure_ascii=False))
                try:
                    now = await asyncio.wait_for(said.get(), BEAT)
                except TimeoutError:
                    continue

        async def gone() -> None:
            while (await receive())["type"] != "http.disconnect":
                pass

        work = asyncio.ensure_future(self.work(said.put_nowait))
        others = [asyncio.create_task(tell()), asyncio.create_task(gone())]
        try:
            await asyncio.wait([work, *others], return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in others:
                task.cancel()
            # A line that is being sent is finished or given up before the last one.
            await asyncio.gather(*others, return_exceptions=True)
            if not work.done():
                work.cancel()
                await asyncio.gather(work, return_exceptions=True)
        if work.cancelled():
            return
        try:
            await line(f'{{"result":{work.result()}}}', more=False)
        except RefusedError as error:
            refused = {"error": error.sentence, "line": error.line}
            await line(json.dumps(refused, ensure_ascii=False), more=False)
