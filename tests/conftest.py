"""What tests of several files share: where the measured records are, if they are, and plants for the estimators."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Prior, Record

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"

# At import, so that child processes and the collection of tests see it too; tests that need the records skip elsewhere.
if BESIDE.is_dir():
    os.environ.setdefault("UNMODELLED_DATA", str(BESIDE))

# A run in the background of a script ignores these, and so would the commands that the tests start and stop.
for name, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) is signal.SIG_IGN:
        signal.signal(getattr(signal, name), handler)

OSCILLATOR = Model(
    name="oscillator",
    states={"p": "v", "v": "-c*v - 2*p"},
    parameters={"c": Parameter(0.3)},
    outputs={"p": Output("p", "p"), "s": Output("v + 0.5*p", "s")},
    initial={"p": Initial(1.0), "v": Initial(0.0)},
)
PENDULUM = Model(
    name="driven pendulum",
    states={"angle": "rate", "rate": "F - c*rate - k*sin(angle)"},
    parameters={"c": Parameter(0.3), "k": Parameter(2.0)},
    inputs={"F": Input("F", "linear")},
    outputs={"a": Output("angle", "a", angle=True), "r": Output("rate", "r")},
    initial={"angle": Initial(0.0), "rate": Initial(0.0)},
)
PRIOR = Prior(np.array([0.9, 0.1]), np.diag([0.3, 0.1]), np.array([0.02, 0.01]), np.array([0.0, 0.4]))


def record_of(model: Model, samples: int = 41, dt: float = 0.05, gaps: bool = True) -> Record:
    """Uneven steps, the model driven by what it lacks (a slow force), noise, and a fifth of the readings missing."""
    rng = np.random.default_rng(4)
    t = np.cumsum(dt * rng.uniform(0.5, 1.5, samples))
    force = "F" in model.inputs
    truth = model.plus(list(model.states)[-1], "0.5*sin(0.7*t)")
    u = np.sin(1.5 * t)[:, None] if force else np.zeros((samples, 0))
    x, rows = np.array([0.9, 0.1]), []
    for k in range(samples):
        x = x if k == 0 else truth.step(t[k - 1], x, u[k - 1], t[k] - t[k - 1], u[k])
        rows.append(truth.output(t[k], x, u[k]) + 0.1 * rng.standard_normal(2))
    y = np.array(rows)
    if gaps:
        y[rng.random(y.shape) < 0.2] = np.nan
        y[20:22] = np.nan
    return Record(t, u, y, prior=PRIOR)


@pytest.fixture(scope="session")
def plants() -> SimpleNamespace:
    """An oscillator and a driven pendulum, a prior for both, and `record` of either."""
    return SimpleNamespace(OSCILLATOR=OSCILLATOR, PENDULUM=PENDULUM, PRIOR=PRIOR, record=record_of)


def bench_rows_of(
    errors: dict[str, float], cases: int = 8, seeds: int = 10, variant: str = "default"
) -> list[dict[str, Any]]:
    """Rows of methods whose state errors are `errors`, with a tenth of scatter; inf fails."""
    rng = np.random.default_rng(0)
    return [
        {"case": f"case{case}", "noise": 0.05, "estimator": name, "variant": variant, "seed": seed,
         "status": "ok" if np.isfinite(error) else "diverged",
         "reason": "" if np.isfinite(error) else f"not finite from t = {seed} <on>",
         "state_nrmse": error * np.exp(0.1 * rng.standard_normal()), "d_nrmse": error, "nees": 1.0, "nis": 1.0,
         "step_us": 10.0, "seconds": 0.01, "tuning": {}, "versions": {"unmodelled": "0"}, "when": 1e9}
        for case in range(cases) for name, error in errors.items() for seed in range(seeds)
    ]  # fmt: skip


@pytest.fixture(scope="session")
def bench_rows() -> Callable[..., list[dict[str, Any]]]:
    """A maker of stored rows of a benchmark, by the state error of each method."""
    return bench_rows_of


class Served:
    """A running `unmodelled serve`: its process, the address it printed, its parts, and the folder of its files."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "suite", "serve", "--no-browser", "--port", "0", *arguments]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "TMPDIR": str(folder)},
        )
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()
        self.origin, _, self.token = self.url.partition("/?token=")

    def end(self) -> None:
        """Stop it, however it is."""
        if self.process.poll() is None:
            self.process.terminate()
        self.process.communicate(timeout=30)


@pytest.fixture(scope="module")
def serve(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Served]]:
    """Start servers of the page, which end with the tests of the file."""
    started: list[Served] = []

    def start(*arguments: str) -> Served:
        started.append(Served(tmp_path_factory.mktemp("served"), *arguments))
        return started[-1]

    yield start
    for served in started:
        served.end()


@pytest.fixture(scope="module")
def served(serve: Callable[..., Served]) -> Served:
    """A server with nothing named at its start."""
    return serve()


@pytest.fixture(scope="module")
def client(served: Served) -> Iterator[Any]:
    """A browser's part: the cookie, the Origin, the address."""
    httpx = pytest.importorskip("httpx", reason="the tests ask with httpx")
    with httpx.Client(base_url=served.origin, headers={"origin": served.origin}, timeout=120) as inside:
        assert inside.get("/", params={"token": served.token}).status_code == 303
        yield inside
