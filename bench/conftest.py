"""What the speed tests share: plants, a C compiler, and the ratio of two times taken turn by turn in one run."""

from __future__ import annotations

import ctypes
import importlib.metadata
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from suite.case import Case, Experiment
from suite.model import Initial, Model, Output, Parameter
from suite.record import Prior, Record

Array = npt.NDArray[np.float64]

NAMED = ("numpy", "scipy", "numba", "llvmlite", "filterpy", "casadi", "jax", "pysindy")


def pytest_benchmark_update_machine_info(config: pytest.Config, machine_info: dict[str, Any]) -> None:
    """Versions of what is compared beside the machine, and nothing that names it."""
    for name in ("node", "release"):
        machine_info.pop(name, None)
    versions = {}
    for name in NAMED:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    machine_info["versions"] = versions


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Processor time, which what else the machine does changes little; wall time where a test says so."""
    for item in items:
        if item.get_closest_marker("benchmark") is None:
            item.add_marker(pytest.mark.benchmark(timer=time.process_time))


def children() -> float:
    """Processor time of the commands that have ended, s."""
    spent = os.times()
    return spent.children_user + spent.children_system


class Ratio:
    """Times of ours and of a peer's program, the peer's before and after; the least of each counts.

    What was compared goes to the JSON file as `extra_info`, from which `bench/summary.py` makes the table.
    """

    def __init__(self, benchmark: Any, clock: Callable[[], float]) -> None:
        self.benchmark, self.clock = benchmark, clock

    def __call__(
        self, what: str, ours: Callable[[], Any], peer: str, theirs: Callable[[], Any], *, unit: str = "pass",
        per: int = 1, at_least: float | None = None, at_most: float | None = None, rounds: int = 20, turns: int = 5,
        slow: bool = False,
    ) -> float:  # fmt: skip
        """Peer's time over ours, or with `at_most` ours over the peer's; `per` units in a call.

        Both are called once before, which compiles what is compiled; a `slow` peer is called once in all. Asserts what
        is wanted.
        """
        times = [] if slow else self.timed(theirs, turns + 1)[1:]
        self.benchmark.pedantic(ours, rounds=rounds, warmup_rounds=1)
        times += self.timed(theirs, 1 if slow else turns)
        mine, other = self.benchmark.stats.stats.min / per, min(times) / per
        ratio = mine / other if at_most else other / mine
        reached = ratio <= at_most if at_most else ratio >= (at_least or 1.0)
        wanted = f"at most {at_most:g} times the time" if at_most else "ahead"
        wanted = f"at least {at_least:g} times as fast" if at_least else wanted
        self.note(what, unit, mine, wanted, reached, peer=peer, theirs=other, ratio=ratio)
        return ratio

    def alone(
        self, what: str, ours: Callable[[], Any], *, unit: str, at_most: float, per: int = 1, rounds: int = 5,
        command: bool = False, warm: bool = True,
    ) -> None:  # fmt: skip
        """Our time against a number of seconds; that of a `command` is what its process spends."""
        spent = []

        def timed() -> None:
            before = children()
            ours()
            spent.append(children() - before)

        self.benchmark.pedantic(timed if command else ours, rounds=rounds, warmup_rounds=int(warm))
        mine = min(spent) if command else self.benchmark.stats.stats.min / per
        scale, name = next(pair for pair in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")) if at_most >= pair[0])
        self.note(what, unit, mine, f"at most {at_most / scale:g} {name}", mine <= at_most)

    def timed(self, work: Callable[[], Any], turns: int) -> list[float]:
        times = []
        for _ in range(turns):
            began = self.clock()
            work()
            times.append(self.clock() - began)
        return times

    def note(self, what: str, unit: str, mine: float, wanted: str, reached: bool, **more: Any) -> None:
        clock = "wall" if self.clock is time.perf_counter else "processor"
        self.benchmark.extra_info.update(
            what=what, unit=unit, ours=mine, wanted=wanted, reached=reached, clock=clock, **more
        )
        assert reached, f"{what}: {wanted}; ours {mine:.3g} s a {unit}, {more}"


@pytest.fixture
def ratio(benchmark: Any, request: pytest.FixtureRequest) -> Ratio:
    """Compare ours with a peer's."""
    marked = request.node.get_closest_marker("benchmark")
    return Ratio(benchmark, marked.kwargs["timer"])


def paper(estimated: bool = False) -> SimpleNamespace:
    """The plant of Raol (2016), (100)-(101), n = 2, 40 s at 0.05 s, both states measured: 801 samples.

    `estimated`: the first states are not known.
    """
    model = Model(
        name="driven oscillator with a cubic spring",
        states={"x1": "2.5*cos(t) - a1*x1 - a2*x2 - a3*x2**3", "x2": "x1"},
        parameters={"a1": Parameter(0.68), "a2": Parameter(1.0), "a3": Parameter(0.0195)},
        outputs={"z1": Output("x1", "z1"), "z2": Output("x2", "z2")},
        initial={name: Initial(0.0, estimate=estimated) for name in ("x1", "x2")},
    )
    record, _ = Case("speed", "", model, model, Experiment(40.0, 0.05, (0.0, 0.0))).simulate(0.05, 1)
    prior = Prior(np.zeros(2), 0.1 * np.eye(2), np.array([0.01, 0.01]), np.array([0.05, 0.0]))
    return SimpleNamespace(model=model, record=record, prior=prior)


def chain(n: int, samples: int) -> SimpleNamespace:
    """Masses between hardening springs, n = 2 masses, shaken at one end; every position is measured."""
    states, masses = {}, n // 2
    for i in range(masses):
        left, right = f"x{i - 1}" if i else "sin(t)", f"x{i + 1}" if i < masses - 1 else "0"
        states |= {f"x{i}": f"v{i}", f"v{i}": f"k*({left} - 2*x{i} + {right}) - c*v{i} - b*x{i}**3"}
    model = Model(
        name=f"chain of {masses}",
        states=states,
        parameters={"k": Parameter(4.0), "c": Parameter(0.4), "b": Parameter(0.5)},
        outputs={f"z{i}": Output(f"x{i}", f"z{i}") for i in range(masses)},
        initial={name: Initial(0.0) for name in states},
    )
    experiment = Experiment(0.05 * (samples - 1), 0.05, (0.0,) * n)
    record, _ = Case("speed", "", model, model, experiment).simulate(0.05, 1)
    R = np.maximum(np.nanvar(record.y, axis=0), 1e-6) * 0.01
    prior = Prior(np.zeros(n), 0.1 * np.eye(n), R, np.tile([0.0, 0.05], masses))
    return SimpleNamespace(model=model, record=record, prior=prior)


@pytest.fixture(scope="session")
def plants() -> SimpleNamespace:
    """`paper()` and `chain(n, samples)`: each gives model, record and prior."""
    return SimpleNamespace(paper=paper, chain=chain)


@pytest.fixture(scope="session")
def by_hand(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """Call a function of peer.c, compiled here for this processor; arrays as pointers, the first argument a length."""
    compiler = os.environ.get("CC") or next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("no C compiler is found; install one, or name it in CC")
    library = tmp_path_factory.mktemp("c") / "peer.so"
    source = Path(__file__).with_name("peer.c")
    options = ["-std=c99", "-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run([*compiler.split(), *options, str(source), "-o", str(library), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))

    def prepared(name: str, steps: int, *arrays: Array) -> Callable[[], None]:
        function = getattr(loaded, name)
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]

        def call(kept: Any = arrays) -> None:
            # `kept` holds the arrays while their pointers are in use.
            function(ctypes.c_ssize_t(steps), *pointers)

        return call

    return prepared


@pytest.fixture(scope="session")
def paper_arrays() -> Callable[[SimpleNamespace, Record], list[Array]]:
    """What the functions of peer.c take first: t, y, the parameters."""
    return lambda plant, record: [
        np.ascontiguousarray(a, dtype=np.float64) for a in (record.t, record.y, plant.model.values)
    ]
