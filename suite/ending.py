"""How a command ends that is interrupted, told to stop, or not read: in order, and without a word too many.

- an interrupt at the keyboard: KeyboardInterrupt, once; a second one ends the process at once
- SIGTERM and SIGHUP: SystemExit(128 + the signal), so that what is half written is removed
- a standard stream that was closed by the caller: the null device, so that no file of ours takes its number
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType
from typing import Any

INTERRUPTED = 130  # 128 + SIGINT, as a shell says it
STOPPING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
AGAIN = 0.02  # seconds


def prepare() -> None:
    """Set all of it, in the process of the command; what the caller has set to be ignored stays so."""
    _open_streams()
    for number in (signal.SIGINT, *STOPPING):
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _stop)
    sys.unraisablehook = _unraisable


def finish() -> None:
    """Nothing is left to be done in order: from here a signal simply ends the process."""
    for number in (signal.SIGINT, *STOPPING):
        if signal.getsignal(number) is _stop:
            signal.signal(number, signal.SIG_DFL)


def unread() -> None:
    """Whoever read a stream has gone: nothing more may be written to it, at exit either."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _open_streams() -> None:
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free number is given: this one.
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", closefd=False))


def _stop(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_DFL)
    sys.unraisablehook = _half_made
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(128 + number)


def _unraisable(what: Any) -> None:
    """An interrupt that fell into a destructor or a callback, where Python drops it: it comes again a little later."""
    if not issubclass(what.exc_type, (KeyboardInterrupt, SystemExit)):
        sys.__unraisablehook__(what)
        return
    number = signal.SIGINT if issubclass(what.exc_type, KeyboardInterrupt) else signal.SIGTERM
    signal.signal(number, _stop)
    later = threading.Timer(AGAIN, _send, (number,))
    later.daemon = True
    later.start()


def _half_made(what: Any) -> None:
    """The same after a signal, where a destructor may miss what its constructor did not reach: no word of that."""
    if issubclass(what.exc_type, (KeyboardInterrupt, SystemExit)):
        _unraisable(what)


def _send(number: int) -> None:
    """To the main thread, which may be asleep."""
    if sys.platform == "win32":
        signal.raise_signal(number)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, number)
