"""Warm processes that compute for the server: one is ready before it is needed, and an unwanted job is ended at once.

Short tasks go to the process that answered last, which still holds the model; long ones to the one idle longest.
"""

from __future__ import annotations

import asyncio
import multiprocessing
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
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
    """One process and the pipe to it."""

    def __init__(self) -> None:
        context = _context()
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=worker.serve, args=(far,), daemon=True)
        with interrupts_held():
            self.process.start()
        far.close()
        self.ready = False

    def end(self) -> None:
        """Kill the process; whoever still reads from it finds the end of the pipe."""
        self.process.kill()
        self.process.join()


def _context() -> Any:
    """Where the system can fork, from a process that has everything loaded already: a new one then takes no time.

    That process has one thread, unlike this one, so that a fork of it is sound.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([worker.MORTAL, worker.WARM])
    return context


class Crew:
    """All processes of a server; its methods belong to one event loop."""

    def __init__(self) -> None:
        self.idle: deque[Hand] = deque()
        self.all: set[Hand] = set()
        self.room = asyncio.Semaphore(MOST)
        self.threads = ThreadPoolExecutor(MOST, thread_name_prefix="pipe")
        self.closed = False

    def start(self) -> None:
        """Have processes that are warm when the first task comes."""
        while len(self.idle) < KEPT and len(self.all) < MOST and not self.closed:
            self.idle.appendleft(self._new())

    def close(self) -> None:
        """End every process, whatever it does."""
        self.closed = True
        for hand in self.all:
            hand.end()
        self.threads.shutdown(wait=False)

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
                if not hand.ready:
                    await self._message(hand)
                    hand.ready = True
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
        """The next thing a process says; reading waits in a thread, since a pipe's end is no socket everywhere."""
        try:
            answer: tuple[str, Any] = await asyncio.get_running_loop().run_in_executor(self.threads, hand.pipe.recv)
        except (EOFError, OSError, RuntimeError):
            raise self._lost(hand) from None
        return answer

    def _lost(self, hand: Hand) -> RefusedError:
        if self.closed:
            return RefusedError("the server was stopped", status=503)
        hand.process.join(1.0)
        code = hand.process.exitcode
        return RefusedError(
            f"the computing process ended (code {code}); is there memory enough? Please try it again", status=500
        )

    def _take(self, long: bool) -> Hand:
        while self.idle:
            hand = self.idle.popleft() if long else self.idle.pop()
            if hand.process.is_alive():
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
        self.all.add(hand)
        return hand

    def _bury(self, hand: Hand) -> None:
        hand.end()
        self.all.discard(hand)
