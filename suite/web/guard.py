"""What stands before every request: who may ask, how much may be sent, and what a browser may do with the answer."""

from __future__ import annotations

import hmac
import sys
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from suite.web.jobs import RefusedError

DATA_LIMIT = 200_000_000  # bytes of a data file
LIMIT = 1_000_000  # bytes of anything else
UPLOAD = "/api/data"

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "font-src 'self'; form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Guard:
    """Middleware: refuses a foreign Host, a foreign Origin, a request without the cookie and a body over the limit."""

    def __init__(self, app: ASGIApp, port: int, cookie: str, secret: str) -> None:
        self.app, self.cookie, self.secret = app, cookie, secret
        self.hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]")}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return
        path, headers = scope["path"], Headers(scope=scope)

        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                answer = MutableHeaders(scope=message)
                answer.update(HEADERS)
                if path.startswith("/api") or path == "/":
                    answer["Cache-Control"] = "no-store"
                elif "Cache-Control" not in answer:
                    # The files of the page change with the program, at the same address.
                    answer["Cache-Control"] = "no-cache"
            await send(message)

        refused = self._refused(scope["method"], path, headers)
        most = DATA_LIMIT if path == UPLOAD else LIMIT
        if refused is not None:
            await _drained(receive, most)
            await refused(scope, receive, dressed)
            return
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > most:
                if message.get("more_body", False):
                    await _drained(receive, most)
                raise RefusedError(over(most), status=413)
            return message

        try:
            await self.app(scope, counted, dressed)
        except Exception as error:  # the answer is sent; the server goes on
            print(f"unmodelled: {path[:80]} failed: {type(error).__name__}: {error}", file=sys.stderr)

    def _refused(self, method: str, path: str, headers: Headers) -> Response | None:
        """The refusal, if there is a reason for one that the head of the request shows."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if host not in self.hosts:
            return refusal(f"this server answers for {', '.join(sorted(self.hosts))} only, not for {host[:80]!r}", 403)
        own = f"http://{host}"
        if (origin is not None or method not in ("GET", "HEAD")) and origin != own:
            return refusal(f"a request must come from the page itself (Origin {own}), not from {origin!r:.80}", 403)
        if path != "/" and not self.known(headers):
            return refusal("no cookie of this server: open the address that `unmodelled serve` printed", 403)
        length = headers.get("content-length", "0")
        most = DATA_LIMIT if path == UPLOAD else LIMIT
        if not length.isascii() or not length.isdigit() or int(length[:20]) > most:
            return refusal(over(most), 413)
        return None

    def known(self, headers: Headers) -> bool:
        """Whether the request carries the cookie that the address with the token gave."""
        try:
            morsel = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
        except CookieError:
            return False
        return morsel is not None and same(morsel.value, self.secret)


async def _drained(receive: Receive, most: int) -> None:
    """Read on and keep nothing: who is still sending when the connection is closed never sees the answer.

    To twice the limit, so that whoever sends a little more than that is told; who sends without end is cut off.
    """
    left = 2 * most
    while left > 0:
        message = await receive()
        left -= len(message.get("body", b""))
        if not message.get("more_body", False):
            return


def same(given: str, secret: str) -> bool:
    """Equality in a time that tells nothing of where they differ."""
    return hmac.compare_digest(given.encode(errors="replace"), secret.encode())


def over(most: int) -> str:
    """The sentence on a body that is too large."""
    whole = DATA_LIMIT // 1_000_000
    return f"more than {most // 1_000_000} MB were sent; a data file may have {whole} MB, anything else 1 MB"


def refusal(sentence: str, status: int, line: int | None = None, plain: bool = False) -> Response:
    """An error as the page reads it, or (`plain`) as a person does."""
    if plain:
        return PlainTextResponse(f"unmodelled: {sentence}\n", status)
    # After a body that is too long nobody waits for its end.
    headers = {"Connection": "close"} if status == 413 else None
    return JSONResponse({"error": sentence, "line": line}, status, headers)
