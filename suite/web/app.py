"""The application: routes behind the guard, errors as one sentence, processes and files for as long as it runs."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from suite.web.desk import Desk
from suite.web.guard import Guard, refusal
from suite.web.jobs import RefusedError
from suite.web.routes import ROUTES
from suite.web.static_files import MOUNT


def application(desk: Desk) -> Guard:
    """The app of one server."""

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        desk.open()
        try:
            yield
        finally:
            desk.close()

    app = Starlette(
        routes=[*ROUTES, MOUNT],
        exception_handlers={
            RefusedError: _refused, HTTPException: _http, ClientDisconnect: _left, Exception: _failed,
        },
        lifespan=lifespan,
    )  # fmt: skip
    app.state.desk = desk
    # Outermost, so that an answer to a defect of ours has the headers too.
    return Guard(app, desk.port, desk.cookie, desk.secret)


async def _refused(_: Request, error: Exception) -> Response:
    assert isinstance(error, RefusedError)
    return refusal(error.sentence, error.status, error.line)


async def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    said = {404: "nothing is at this address", 405: "this address is not asked in that way"}
    return refusal(f"{said.get(error.status_code, error.detail)}: {request.url.path[:80]}", error.status_code)


async def _left(_: Request, error: Exception) -> Response:
    return Response(status_code=499)


async def _failed(_: Request, error: Exception) -> Response:
    return refusal(f"This is a defect of unmodelled: {type(error).__name__}", 500)
