"""Warm processes that compute for the server: one is ready before it is needed, and an unwanted job is ended at once.

Short tasks go to the process that answered last, which still holds the model; long ones to the one idle longest.
"""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import threading
from collections import deque
from collections.abc import Callable
from multiprocessing import forkserver
from typing import Any

from suite.processes import interrupts_held
from suite.web import worker

MOST = 6  # processes at a time, of about 300 MB each; further jobs wait for one
KEPT = 2  # idle processes that are kept
PATIENCE = 120.0  # seconds a short task may take


class RefusedError(Exception):
    """Why a request is not answered: a sentence, the line of the model's text it is about, and the HTTP status."""

    def __init__(self, sentence: str, line: int | None = None, status: int = 422) -> None:
        super().__init__(sentence)
        self.sentence, self.line, self.status = sentence, line, status


class Hand:
    """One process and the pipe to it. It starts when `begin` is called, which waits until it can work."""

    def __init__(self) -> None:
        context = _context()
        self.pipe, self.far = context.Pipe()
        self.process = context.Process(target=worker.serve, args=(self.far,), daemon=True)
        self.unwanted = False
        self.ready: asyncio.Future[Any] | None = None

    def begin(self) -> None:
        """Start the process and hear that it has; for a thread, since both take as long as loading does."""
        with interrupts_held():
            self.process.start()
        self.far.close()
        if self.unwanted:
            self.process.kill()
        self.pipe.recv()

    def end(self) -> None:
        """Kill the process; whoever still reads from it finds the end of the pipe."""
        self.unwanted = True
        if self.process.pid is not None:
            self.process.kill()
            self.process.join()

    @property
    def alive(self) -> bool:
        """Whether it works or still starts."""
        return self.process.pid is None or self.process.is_alive()


def _context() -> Any:
    """Where the system can fork, from a process that has everything loaded already: a new one then takes no time.

    That process has one thread, unlike this one, so that a fork of it is sound.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([worker.MORTAL, worker.WARM])
    return context


def _in_thread(call: Callable[[], Any]) -> asyncio.Future[Any]:
    """The result of a call that waits. Its thread holds nothing up when the server stops, unlike a pool's."""
    loop = asyncio.get_running_loop()
    future: asyncio.Future[Any] = loop.create_future()

    def settle(result: Any, error: BaseException | None) -> None:
        if not future.done():
            future.set_exception(error) if error is not None else future.set_result(result)

    def run() -> None:
        result, failure = None, None
        try:
            result = call()
        except Exception as error:  # whoever awaits the future gets it
            failure = error
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
            loop.call_soon_threadsafe(settle, result, failure)

    threading.Thread(target=run, daemon=True).start()
    return future


class Crew:
    """All processes of a server; its methods belong to one event loop."""

    def __init__(self) -> None:
        self.idle: deque[Hand] = deque()
        self.all: set[Hand] = set()
        self.room = asyncio.Semaphore(MOST)
        self.closed = False

    def start(self) -> None:
        """Have processes that are warm when the first task comes; for the main thread, with which they end."""
        if "forkserver" in multiprocessing.get_all_start_methods():
            _context()
            with interrupts_held():
                forkserver.ensure_running()
        while len(self.idle) < KEPT and len(self.all) < MOST and not self.closed:
            self.idle.appendleft(self._new())

    def close(self) -> None:
        """End every process, whatever it does."""
        self.closed = True
        for hand in list(self.all):
            hand.end()

    async def call(self, name: str, *arguments: Any) -> Any:
        """The answer of a short task."""
        try:
            async with asyncio.timeout(PATIENCE):
                return await self._run(name, arguments, lambda _: None, long=False)
        except TimeoutError:
            raise RefusedError(
                f"not done after {PATIENCE:.0f} seconds; take fewer samples or a simpler model", status=503
            ) from None

    async def work(self, name: str, *arguments: Any, tell: Callable[[str], None]) -> Any:
        """The answer of a long task, which tells what it is at; cancelling ends its process."""
        return await self._run(name, arguments, tell, long=True)

    async def _run(self, name: str, arguments: tuple[Any, ...], tell: Callable[[str], None], long: bool) -> Any:
        async with self.room:
            hand = self._take(long)
            sound = False
            try:
                assert hand.ready is not None
                # Another may wait for the same process after this one has left.
                await self._heard(hand, asyncio.shield(hand.ready))
                hand.pipe.send((name, arguments))
                while True:
                    kind, said = await self._message(hand)
                    if kind != worker.TOLD:
                        sound = True
                        break
                    tell(said)
            except OSError:
                raise self._lost(hand) from None
            finally:
                self._back(hand, sound, long)
        if kind == worker.DONE:
            return said
        if kind == worker.REFUSED:
            raise RefusedError(*said)
        raise RefusedError(said, status=500)

    async def _message(self, hand: Hand) -> tuple[str, Any]:
        """The next thing a process says."""
        answer: tuple[str, Any] = await self._heard(hand, _in_thread(hand.pipe.recv))
        return answer

    async def _heard(self, hand: Hand, future: asyncio.Future[Any]) -> Any:
        try:
            return await future
        except (EOFError, OSError):
            raise self._lost(hand) from None

    def _lost(self, hand: Hand) -> RefusedError:
        if self.closed:
            return RefusedError("the server was stopped", status=503)
        hand.end()
        code = hand.process.exitcode if hand.process.pid is not None else "none"
        return RefusedError(
            f"the computing process ended (code {code}); is there memory enough? Please try it again", status=500
        )

    def _take(self, long: bool) -> Hand:
        while self.idle:
            hand = self.idle.popleft() if long else self.idle.pop()
            if hand.alive:
                break
            self._bury(hand)
        else:
            hand = self._new()
        if not self.idle and len(self.all) < MOST:
            self.idle.append(self._new())
        return hand

    def _back(self, hand: Hand, sound: bool, long: bool) -> None:
        if sound and not self.closed:
            (self.idle.appendleft if long else self.idle.append)(hand)
            while len(self.idle) > KEPT:
                self._bury(self.idle.popleft())
        else:
            self._bury(hand)
            self.start()

    def _new(self) -> Hand:
        if self.closed:
            raise RefusedError("the server was stopped", status=503)
        hand = Hand()
        hand.ready = _in_thread(hand.begin)
        # It may be ended before anybody waits for it; its failure is then no news.
        hand.ready.add_done_callback(lambda ready: ready.cancelled() or ready.exception())
        self.all.add(hand)
        return hand

    def _bury(self, hand: Hand) -> None:
        hand.end()
        self.all.discard(hand)
