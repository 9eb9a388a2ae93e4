"""Signals reach who is to hear them: the command once, and none of its children."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

DROPPED = """
import signal, sys, time
from suite import ending

class Interrupted:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

ending.prepare()
try:
    Interrupted()
    time.sleep(600)
    print("went on")
except KeyboardInterrupt:
    print("stopped", flush=True)
    signal.raise_signal(signal.SIGINT)
    print("a second one goes through")
"""


def test_an_interrupt_is_not_lost_in_a_destructor_and_a_second_one_ends_at_once() -> None:
    """Python drops exceptions there, with a traceback; the interrupt comes again."""
    process = subprocess.Popen(
        [sys.executable, "-c", DROPPED], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.communicate(timeout=120) == ("stopped\n", "")
    assert process.returncode == -signal.SIGINT


HALF_MADE = """
import signal
from suite import ending

class HalfMade:
    def __del__(self):
        self.pointer

ending.prepare()
try:
    HalfMade()
    signal.raise_signal(signal.SIGINT)
except KeyboardInterrupt:
    HalfMade()
    print("stopped", flush=True)
"""


def test_what_was_half_made_when_the_interrupt_came_goes_without_a_word() -> None:
    """An object of a library, whose destructor misses what its constructor did not reach; before, it is a defect."""
    done = subprocess.run([sys.executable, "-c", HALF_MADE], capture_output=True, text=True, timeout=60)
    assert done.stdout == "stopped\n"
    assert done.stderr.count("AttributeError") == 1


FIRST_CHILDREN = """
import multiprocessing
import signal
from suite.processes import interrupts_held

def held(pipe):
    pipe.send(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))

if __name__ == "__main__":
    for kind in ("spawn", "forkserver"):
        context = multiprocessing.get_context(kind)
        near, far = context.Pipe()
        process = context.Process(target=held, args=(far,))
        with interrupts_held():
            process.start()
        print(near.recv())
        process.join()
    print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="there are no masks of signals")
@pytest.mark.parametrize("kinds", [("spawn", "forkserver"), ("forkserver", "spawn")])
def test_no_child_hears_an_interrupt_not_even_the_first(tmp_path: Path, kinds: tuple[str, str]) -> None:
    """Whichever way of starting comes first, and the parent goes on hearing it."""
    (tmp_path / "first.py").write_text(FIRST_CHILDREN.replace('("spawn", "forkserver")', str(kinds)))
    done = subprocess.run([sys.executable, "first.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["True", "True", "False"], done.stderr
