"""Watching sample by sample: the batch filter's numbers, alarms at the stated rate, and lines as they come."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from suite.alarm import Alarm
from suite.errors import DataError
from suite.filtering import filtered
from suite.following import follow, uncertain
from suite.least_squares import LeastSquares
from suite.model import Initial, Model, Output, Parameter
from suite.model_file import write_model
from suite.record import Prior, Record
from suite.sample_lines import samples
from suite.streaming import Filter
from suite.watch import Watcher, first_prior

SIGMA, DT = 0.05, 0.05
SPRING = Model(
    name="oscillator",
    states={"p": "v", "v": "2.5*cos(t) - c*v - k*p"},
    parameters={"c": Parameter(0.68, sd=0.05), "k": Parameter(1.0, sd=0.05)},
    outputs={"pos": Output("p", "pos", sigma=SIGMA)},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
CUBIC = SPRING.plus("v", "-a*p**3", {"a": Parameter(0.0, free=True)})
TURNED = CUBIC.with_values({"a": 0.0195})


def record(seed: int, onset: float, duration: float = 60.0, steps: np.ndarray | None = None) -> Record:
    """The oscillator, whose spring turns cubic at the onset; the position with noise SIGMA."""
    t = np.arange(0.0, duration, DT) if steps is None else np.concatenate([[0.0], np.cumsum(steps)])
    x, path = np.zeros(2), np.zeros((len(t), 2))
    for k in range(len(t)):
        path[k] = x
        if k + 1 < len(t):
            x = (TURNED if t[k] >= onset else SPRING).step(t[k], x, (), t[k + 1] - t[k])
    y = path[:, :1] + SIGMA * np.random.default_rng(seed).standard_normal((len(t), 1))
    return Record(t, np.zeros((len(t), 0)), y)


def readings(run: Record, watcher: Watcher) -> list:
    return [watcher.add(float(t), u, y) for t, u, y in zip(run.t, run.u, run.y, strict=True)]


def text(run: Record) -> list[str]:
    return ["t,pos\n", *(f"{t!r},{y!r}\n" for t, y in zip(run.t.tolist(), run.y[:, 0].tolist(), strict=True))]


def test_a_sample_at_a_time_is_the_batch_filter() -> None:
    """Streamed states, covariances and innovations are those of `filtered`, with gaps and irregular steps."""
    rng = np.random.default_rng(1)
    run = record(2, 5.0, steps=DT * rng.uniform(0.3, 2.0, 200))
    run.y[rng.random(201) < 0.3] = np.nan
    prior = Prior(np.array([0.1, -0.2]), np.diag([0.1, 0.2]), np.array([SIGMA**2]), np.array([0.0, 0.3]))
    batch, stream = filtered(SPRING, run, prior.x0, prior.P0, prior.Q, prior.R, spread=True), Filter(SPRING, prior)
    for k in range(len(run)):
        stream.add(float(run.t[k]), run.u[k], run.y[k])
        np.testing.assert_allclose(stream.x, batch.x[k], rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(stream.P, batch.P[k], rtol=1e-12, atol=1e-14)
        expected = np.nan if np.isnan(run.y[k, 0]) else batch.innovation[k, 0] / np.sqrt(batch.variance[k, 0])
        np.testing.assert_allclose(stream.innovation[0], expected, rtol=1e-12)


def test_the_watcher_runs_its_filters_as_if_each_were_alone() -> None:
    """Innovation, coefficient and its band are those of a filter and of least squares fed apart, with gaps."""
    run = record(4, np.inf, 20.0)
    run.y[np.random.default_rng(4).random(len(run)) < 0.2] = np.nan
    first, own = run.part(0, 40), uncertain(SPRING)
    watcher, prior = Watcher(SPRING, first, CUBIC, ["a"], memory=10.0), first_prior(SPRING, first)
    plain = Filter(*follow(SPRING, prior, own))
    start = watcher.add(float(run.t[0]), run.u[0], run.y[0])
    squares = LeastSquares(CUBIC, prior, {"a": float(start.coefficients_sd[0])}, own, 10.0, 1)
    for alone in (plain, squares):
        alone.add(float(run.t[0]), run.u[0], run.y[0])
    for t, u, y in zip(run.t[1:].tolist(), run.u[1:], run.y[1:], strict=True):
        found = watcher.add(t, u, y)
        plain.add(t, u, y)
        squares.add(t, u, y)
        np.testing.assert_allclose(found.innovation, plain.innovation, rtol=1e-12)
        np.testing.assert_allclose(found.coefficients, squares.value, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found.coefficients_sd, squares.sd, rtol=1e-9)
    assert found.coefficients_sd[0] < 0.5 * start.coefficients_sd[0]


def test_a_sample_without_a_measurement_forgets_nothing() -> None:
    """What is known of the coefficient stays through a gap; the first measured sample after it forgets its own step."""
    run = record(4, np.inf, 20.0)
    prior = first_prior(SPRING, run.part(0, 40))
    squares = LeastSquares(CUBIC, prior, {"a": 0.1}, {}, 10.0, 1)
    for t, y in zip(run.t[:200].tolist(), run.y[:200], strict=True):
        squares.add(t, np.zeros(0), y)
    known = squares.filter.P[-1, -1]
    for t in run.t[200:300].tolist():
        squares.add(t, np.zeros(0), np.array([np.nan]))
    assert squares.filter.P[-1, -1] == pytest.approx(known, rel=1e-9)


@pytest.mark.parametrize("channels", [1, 3])
def test_the_alarm_comes_at_its_stated_rate_on_noise(channels: int) -> None:
    """White innovations of unit variance raise it once in 1 / rate samples, within 4 standard errors of 150 waits."""
    rng, rate, waits = np.random.default_rng(7), 5e-3, []
    for _ in range(150):
        alarm, waited = Alarm(rate, channels), 0
        while alarm.since is None:
            waited += 1
            alarm.add(float(waited), rng.standard_normal(channels))
        waits.append(waited)
    assert np.mean(waits) == pytest.approx(1.0 / rate, abs=4.0 * np.std(waits) / np.sqrt(len(waits)) + channels)


def test_one_outlier_raises_no_alarm() -> None:
    """A single innovation of a thousand sd does not, at a rate of 1e-3; eight of 4 sd in a row do."""
    alarm = Alarm(1e-3, 1)
    alarm.add(0.0, np.array([1e3]))
    assert alarm.since is None
    for k in range(8):
        alarm.add(1.0 + k, np.array([4.0]))
    assert alarm.since == 0.0


def test_null_records_raise_alarms_at_the_stated_rate() -> None:
    """Ten plants that stay as modelled, 1160 watched samples each at 2e-3: about 23 alarms, between 8 and 42."""
    count = 0
    for seed in range(10):
        run = record(100 + seed, np.inf)
        found = [r.since is not None for r in readings(run, Watcher(SPRING, run.part(0, 40), rate=2e-3))]
        count += int(np.sum(np.diff(np.array(found, dtype=int)) == 1))
    assert 8 <= count <= 42


def test_a_spring_that_turns_cubic_raises_the_alarm() -> None:
    """At one false alarm in 1e5 samples it comes within 60 samples of the onset, and dates it within 40."""
    onset = 30.0
    for seed in range(5):
        run = record(seed, onset, 35.0)
        found = readings(run, Watcher(SPRING, run.part(0, 40)))
        first = next(r for r in found if r.since is not None)
        assert onset < first.t < onset + 60 * DT
        assert first.since is not None
        assert abs(first.since - onset) < 40 * DT


def test_the_coefficient_and_the_model_error_are_within_their_bands() -> None:
    """Of 10 plants, cubic throughout, a and d lie within 2 sd at the end in at least 7; so they do where a = 0."""
    for onset, a in ((0.0, 0.0195), (np.inf, 0.0)):
        z_a, z_d = [], []
        for seed in range(10):
            run = record(seed, onset, 30.0)
            last = readings(run, Watcher(SPRING, run.part(0, 40), CUBIC, ["a"], memory=40.0))[-1]
            z_a.append((last.coefficients[0] - a) / last.coefficients_sd[0])
            assert last.coefficients_sd[0] < 0.2 * 0.0195
            exact = readings(run, Watcher(TURNED if a else SPRING, run.part(0, 40)))[-1]
            z_d.append(exact.d[0] / exact.d_sd[0])
        assert np.sum(np.abs(z_a) < 2.0) >= 7, z_a
        assert np.sum(np.abs(z_d) < 2.0) >= 7, z_d


def test_after_the_alarm_the_coefficient_is_the_new_one() -> None:
    """Before the onset 0 and 30 s after it 0.0195, both within 3 sd, with bands below half of it."""
    run = record(3, 30.0)
    found = readings(run, Watcher(SPRING, run.part(0, 40), CUBIC, ["a"]))
    for at, a in ((590, 0.0), (-1, 0.0195)):
        reading = found[at]
        assert abs(reading.coefficients[0] - a) < 3.0 * reading.coefficients_sd[0]
        assert reading.coefficients_sd[0] < 0.5 * 0.0195


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("0.2,x\n", "line 4, column pos: expected a number, got 'x'"),
        ("0.2\n", "line 4: 1 cells under 2 column names"),
        ("0.05,1\n", "line 4: time does not increase"),
        ("0.2,inf\n", "line 4, column pos"),
        (",1\n", "line 4: no time in column t"),
    ],
)
def test_a_broken_line_is_named(line: str, expected: str) -> None:
    """What came before is given, then the error has the number of the line, comments counted."""
    coming = samples(io.StringIO("t,pos\n# comment\n0.1,1\n" + line), SPRING, "input")
    assert next(coming)[0] == 0.1
    with pytest.raises(DataError, match=expected):
        next(coming)


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    write_model(SPRING, tmp_path / "plant.toml")
    return tmp_path / "plant.toml"


def start(plant: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "suite", "watch", str(plant), "-", *options]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, bufsize=1)


def test_lines_come_before_the_input_ends_and_an_interrupt_ends_it(plant: Path) -> None:
    """Each line fed is answered before the next is; Ctrl-C then ends it with 130 and no traceback."""
    run = record(1, np.inf, 5.0)
    run.y[45] = np.nan
    process = start(plant, "--json", "--effect", "cubic_stiffness")
    assert process.stdin is not None
    assert process.stdout is not None
    lines = text(run)
    for line in lines[:41]:
        process.stdin.write(line)
    answers = [json.loads(process.stdout.readline()) for _ in range(40)]
    for line in lines[41:60]:
        process.stdin.write(line.replace("nan", ""))
        answers.append(json.loads(process.stdout.readline()))
    assert [answer["t"] for answer in answers] == run.t[:59].tolist()
    assert answers[45]["innovation"]["pos"] is None
    assert answers[46]["innovation"]["pos"] is not None
    assert answers[-1]["effect"]["equation"] == "v"
    assert answers[-1]["effect"]["coefficients"]["a"]["sd"] > 0.0
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors


def test_what_was_good_is_written_before_a_broken_line_is_refused(plant: Path) -> None:
    """Also where the first samples are not complete; one sentence, exit code 2."""
    for good in (10, 60):
        lines = text(record(1, np.inf, 5.0))[: good + 1]
        out, errors = (process := start(plant)).communicate("".join([*lines, "3.5,oops\n", "3.6,1\n"]), timeout=60)
        assert process.returncode == 2
        rows = out.splitlines()
        assert rows[0] == "t,innovation_pos,d_v,d_v_sd,statistic,alarm_since"
        assert len(rows) == good + 1
        assert errors.strip().splitlines() == [
            f"unmodelled: standard input, line {good + 2}, column pos: expected a number, got 'oops'; "
            "correct it, or leave the cell empty if it is missing"
        ]


def test_the_alarm_is_in_the_lines_and_in_the_exit_code(plant: Path) -> None:
    """With --strict a run with an alarm ends with 1; the last column says since when."""
    lines = text(record(2, 10.0, 20.0))
    out, _ = (process := start(plant, "--strict")).communicate("".join(lines), timeout=60)
    assert process.returncode == 1
    since = {float(row.rsplit(",", 1)[1]) for row in out.splitlines()[1:] if not row.endswith(",")}
    assert any(abs(t - 10.0) < 2.0 for t in since)
