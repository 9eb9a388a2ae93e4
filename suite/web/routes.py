"""The addresses of the server: each reads a request, hands it to a process, and passes the answer on."""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Callable

from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse, Response
from starlette.routing import Route

from suite import __version__
from suite.web.asked import asked
from suite.web.desk import Desk
from suite.web.guard import DATA_LIMIT, refusal, same
from suite.web.jobs import RefusedError
from suite.web.static_files import STATIC
from suite.web.stream import Lines


def desk_of(request: Request) -> Desk:
    """What this server holds."""
    desk: Desk = request.app.state.desk
    return desk


async def page(request: Request) -> Response:
    """The page; with the token it is the cookie that is given, and the token leaves the address."""
    desk = desk_of(request)
    if same(request.query_params.get("token", ""), desk.token):
        answer = RedirectResponse("/", 303)
        answer.set_cookie(desk.cookie, desk.secret, httponly=True, samesite="strict", path="/")
        return answer
    if not same(request.cookies.get(desk.cookie, ""), desk.secret):
        return refusal("open the whole address that `unmodelled serve` printed, with its token", 403, plain=True)
    return FileResponse(STATIC / "index.html", media_type="text/html")


def _json(text: str) -> Response:
    return Response(text, media_type="application/json")


async def start(request: Request) -> Response:
    """What the page opens with."""
    desk = desk_of(request)
    return _json(
        json.dumps(
            {
                "version": __version__,
                "limit": DATA_LIMIT,
                "loaded": desk.loaded,
                "bench": desk.store is not None,
            }
        )
    )


async def examples(request: Request) -> Response:
    """The list of ready models."""
    task = desk_of(request).examples
    assert task is not None
    # The task is everybody's: who leaves does not end it.
    return _json(await asyncio.shield(task))


async def data(request: Request) -> Response:
    """A data file comes in; what is no table is refused and removed."""
    desk = desk_of(request)
    entry = await desk.uploads.take(request.query_params.get("name", ""), request.stream())
    try:
        await desk.crew.call("data", str(entry.path), entry.name)
    except BaseException:
        desk.uploads.drop(entry.id)
        raise
    return _json(json.dumps(entry.to_json()))


async def example(request: Request) -> Response:
    """A ready model with its data."""
    desk, said = desk_of(request), await asked(request)
    folder = desk.uploads.folder / secrets.token_hex(8)
    written = json.loads(await desk.crew.call("example", said.text("name"), str(folder)))
    files = [desk.uploads.given(folder / path, name) for path, name in written.pop("files")]
    return _json(json.dumps({**written, "data": [entry.to_json() for entry in files]}))


async def model(request: Request) -> Response:
    """What a model's text says."""
    said = await asked(request)
    return _json(await desk_of(request).crew.call("model", said.text("model")))


async def compare(request: Request) -> Response:
    """The model beside the data."""
    desk, said = desk_of(request), await asked(request)
    return _json(await desk.crew.call("compare", said.text("model"), desk.uploads.find(said.names("data"))))


async def simulate(request: Request) -> Response:
    """The free run at the values of the sliders."""
    desk, said = desk_of(request), await asked(request)
    source, files, numbers = said.text("model"), desk.uploads.find(said.names("data")), said.numbers("values")
    async with desk.sliding:
        # A slider has moved on meanwhile.
        if await request.is_disconnected():
            raise ClientDisconnect
        return _json(await desk.crew.call("simulate", source, files, numbers))


async def values(request: Request) -> Response:
    """The model's text with the values of the sliders."""
    said = await asked(request)
    return _json(await desk_of(request).crew.call("values", said.text("model"), said.numbers("values")))


async def analyse(request: Request) -> Response:
    """One round of discovery, with its progress."""
    desk, said = desk_of(request), await asked(request)
    source, files, absolute = said.text("model"), desk.uploads.find(said.names("data")), said.flag("absolute")
    key = secrets.token_hex(8)

    async def work(tell: Callable[[str], None]) -> str:
        text, blob = await desk.crew.work("analyse", source, files, absolute, key, tell=tell)
        desk.keep(key, blob)
        return str(text)

    return Lines(work)


async def report(request: Request) -> Response:
    """The report of some analyses."""
    desk, said = desk_of(request), await asked(request)
    kept = desk.kept(said.names("analyses"))
    return HTMLResponse(await desk.crew.work("report", kept, tell=lambda _: None))


async def bench(request: Request) -> Response:
    """The stored results of the benchmark."""
    return _json(await desk_of(request).crew.call("bench", _store(request)))


async def cell(request: Request) -> Response:
    """One of them, computed again."""
    desk, store, key = desk_of(request), _store(request), request.query_params.get("key", "")

    async def work(tell: Callable[[str], None]) -> str:
        return str(await desk.crew.work("cell", store, key, tell=tell))

    return Lines(work)


def _store(request: Request) -> str:
    store = desk_of(request).store
    if store is None:
        raise RefusedError("no benchmark is open; start with: unmodelled serve --store results.sqlite", status=404)
    return str(store)


ROUTES = [
    Route("/", page),
    Route("/api/start", start),
    Route("/api/examples", examples),
    Route("/api/data", data, methods=["POST"]),
    Route("/api/example", example, methods=["POST"]),
    Route("/api/model", model, methods=["POST"]),
    Route("/api/compare", compare, methods=["POST"]),
    Route("/api/simulate", simulate, methods=["POST"]),
    Route("/api/values", values, methods=["POST"]),
    Route("/api/analyse", analyse, methods=["POST"]),
    Route("/api/report", report, methods=["POST"]),
    Route("/api/bench", bench),
    Route("/api/bench/cell", cell),
]
