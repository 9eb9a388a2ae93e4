"""The verb `serve`: bind the port, print the address, serve until interrupted."""

from __future__ import annotations

import argparse
import contextlib
import errno
import json
import os
import signal
import socket
import sys
import threading
import webbrowser
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import FrameType

from suite.ending import STOPPING
from suite.errors import InputError

PORT = 8420
TRIED = 20  # ports from the first one on, where none was asked for


def run(args: argparse.Namespace) -> int:
    """Serve the page on the loopback interface; 0 when it is stopped."""
    for path in (*args.data, args.store):
        _readable(path)
    model = _text(args.model)
    for name in ("starlette", "uvicorn"):
        if find_spec(name) is None:
            raise InputError(f"the page needs {name}; install it with: pip install 'unmodelled[web]'")
    listener = _bound(args.port)
    try:
        _serve(args, model, listener)
    except KeyboardInterrupt:
        pass
    finally:
        listener.close()
    print("unmodelled: stopped", file=sys.stderr)
    return 0


def _serve(args: argparse.Namespace, model: str | None, listener: socket.socket) -> None:
    import uvicorn

    from suite.web.app import application
    from suite.web.desk import Desk

    port = listener.getsockname()[1]
    desk = Desk(port, model, args.data, args.store)

    class Server(uvicorn.Server):
        """Ends its processes at the first interrupt, so that no answer is waited for."""

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            desk.crew.close()
            super().handle_exit(sig, frame)

        @contextlib.contextmanager
        def capture_signals(self) -> Iterator[None]:
            """The end of the terminal too, which uvicorn leaves to whatever runs at that moment."""
            with super().capture_signals():
                heard = [number for number in STOPPING if signal.getsignal(number) is not signal.SIG_IGN]
                before = {number: signal.signal(number, self.handle_exit) for number in heard}
                try:
                    yield
                finally:
                    for number, handler in before.items():
                        signal.signal(number, handler)

    config = uvicorn.Config(
        application(desk), log_level="error", access_log=False, lifespan="on", ws="none", http="h11",
        server_header=False, proxy_headers=False, timeout_graceful_shutdown=1,
    )  # fmt: skip
    # Whoever reads the address may connect at once: the socket already listens.
    listener.listen(128)
    print(json.dumps({"url": desk.url}) if args.json else desk.url, flush=True)
    print("unmodelled: open this address in a browser on this machine; Ctrl-C stops the server", file=sys.stderr)
    if not (args.no_browser or args.json) and _has_screen():
        threading.Thread(target=webbrowser.open, args=(desk.url,), daemon=True).start()
    try:
        Server(config).run([listener])
    finally:
        desk.close()


def _bound(port: int | None) -> socket.socket:
    """A socket on the port asked for, or on the first free one from the usual on."""
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"--port: expected a number from 0 to 65535, got {port}; write --port {PORT}")
    ports = [port] if port is not None else list(range(PORT, PORT + TRIED))
    for number in ports:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        if os.name == "posix":
            # Elsewhere this would let two servers share a port.
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", number))
        except OSError as error:
            listener.close()
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise
            continue
        return listener
    which = f"port {port} is" if port is not None else f"ports {PORT} to {PORT + TRIED - 1} are"
    raise InputError(f"--port: {which} taken or not allowed; choose another, or --port 0 for any free one")


def _text(path: Path | None) -> str | None:
    """The text of the model file; what is wrong in it the page says, at its line."""
    _readable(path)
    if path is None:
        return None
    from suite.model_file import LARGEST

    if path.stat().st_size > LARGEST:
        raise InputError(
            f"{path}: larger than {LARGEST // 1000} kB, too large for a model file; is it the data? "
            "The model comes first"
        )
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8; the model comes first, then the data") from None


def _readable(path: Path | None) -> None:
    """Refuse at once what cannot be opened."""
    if path is None:
        return
    if not path.is_file():
        raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; check the path")
    with path.open("rb"):
        pass


def _has_screen() -> bool:
    """Whether there is a screen for a browser: without one a text browser would take the terminal."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
