"""Where it fails is said rightly: bands that cover, sentences that are true, correlations that chance leaves inside."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from suite import plugins
from suite.case import Case, Experiment
from suite.discovery.discrepancy import discrepancy
from suite.discovery.evidence import MOST, to_json
from suite.discovery.fit import prepare
from suite.discovery.misfit import _worst, compare
from suite.discovery.result import Discrepancy
from suite.discovery.state_map import axes, bins, state_map
from suite.discovery.where import _passages, where
from suite.discovery.whiteness import BAND, LAGS, cross_correlation, whiteness
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Record

Array = npt.NDArray[np.float64]

OSCILLATOR = Model(
    "oscillator",
    {"p": "v", "v": "F - c*v - k*p"},
    {"c": Parameter(0.3, fixed=True), "k": Parameter(4.0, fixed=True)},
    inputs={"F": Input("F")},
    outputs={"p": Output("p", "p")},
    initial={"p": Initial(0.5), "v": Initial(0.0)},
)


def found(t: Array, p: Array, d: Array, variable: str = "p", runs: int = 1) -> tuple[Discrepancy, Record]:
    """A discrepancy d (N,) of v' with a band of +-0.2 around it, over a position p and its rate."""
    starts = tuple(int(k * len(t) / runs) for k in range(runs))
    v = np.gradient(p, t)
    values = {"p": p, "v": v, "t": t}[variable]
    wide = np.column_stack([0 * t, np.full_like(t, 0.1)])
    record = Record(t, np.zeros((len(t), 1)), p[:, None], starts)
    return Discrepancy(np.column_stack([p, v]), np.column_stack([0 * t, d]), wide, "v", variable, 0.9, values), record


T = np.arange(600) * 0.05
SWING = 2.0 * np.sin(2.0 * T)
NOISE = 0.05 * np.random.default_rng(1).standard_normal(600)


@pytest.mark.parametrize(
    ("p", "d", "variable", "said"),
    [
        (SWING, -((SWING / 1.5) ** 9), "p", r"for \|p\| > 1\.[23]\d*, in every cycle\."),
        (SWING, np.where(SWING > 1.0, 1.0, 0.0), "p", r"for p > (0\.9\d*|1), in every cycle\."),
        (SWING, np.where(SWING < -1.0, 1.0, 0.0), "p", r"for p < -(0\.9\d*|1), in every cycle\."),
        (SWING, np.where(abs(np.cos(2 * T)) < 0.3, 1.0, 0.0), "v", r"for \|v\| < 1\.[123], at the turning points of p"),
        (SWING, np.where((SWING > 1.0) & (T < 9), 1.0, 0.0), "p", r"for p > (0\.9\d*|1), only before t = 7\.\d"),
        (SWING, np.where((T > 10) & (T < 14), 1.0, 0.0), "p", r"only for t from (9\.\d|10) to 1[345]\."),
        (T / 10, np.where(T > 20, 1.0, 0.0), "p", r"for p > (1\.9\d*|2)\.$"),
        (SWING, np.ones(600), "p", r"throughout the whole record, always to the same side\."),
        (SWING, 0 * T, "p", "stays within its band"),
        (SWING, np.where(np.sin(37 * T) > 0.2, 1.0, 0.0), "p", r"in 4\d % of the samples, in no one range of p"),
    ],
)
def test_a_constructed_failure_is_put_into_words(p: Array, d: Array, variable: str, said: str) -> None:
    """Thresholds, sides, cycles, turning points and times are those that were built in."""
    assert_said(where(*found(T, p, d + NOISE, variable), OSCILLATOR), said)


def assert_said(text: str, pattern: str) -> None:
    assert re.search(pattern, text), text


def test_a_sentence_of_random_failures_is_true() -> None:
    """Whatever fails, a named region holds mostly failures, and "every cycle" means each passage."""
    rng = np.random.default_rng(11)
    for _ in range(60):
        N = int(rng.integers(20, 400))
        t = np.arange(N) * 0.1
        p = rng.uniform(0.5, 3) * np.sin(rng.uniform(0.2, 3) * t) + rng.uniform(-1, 1)
        d = np.where(p > rng.uniform(-1, 1), 1.0, 0.0) * np.where(rng.random(N) < rng.uniform(0.2, 1.0), 1.0, 0.0)
        error, record = found(t, p, d)
        text = where(error, record, OSCILLATOR)
        if " for p > " not in text:
            continue
        level = float(text.split("p > ")[1].split(",")[0].rstrip("."))
        # The threshold is rounded for reading.
        inside = p > level + 0.05 * abs(level)
        assert d[inside].mean() > 0.75, text
        if "every cycle" in text:
            cuts = np.flatnonzero(np.diff(inside.astype(int)))
            for part in np.split(np.arange(N), cuts + 1):
                if inside[part[0]] and len(part) > 5:
                    assert d[part].mean() > 0.4, text


def test_runs_are_told_apart() -> None:
    """In several runs the sentence says whether each of them fails, or which one alone gets there."""
    t = np.tile(np.arange(200) * 0.05, 3)
    p = 2.0 * np.sin(2.0 * t)
    d = np.where(p > 1.0, 1.0, 0.0)
    assert "in every run" in where(*found(t, p, d, runs=3), OSCILLATOR)
    only = np.where(np.arange(600) < 400, 0.4, 1.0) * p
    text = where(*found(t, only, np.where(only > 1.0, 1.0, 0.0), runs=3), OSCILLATOR)
    assert "which only run 3 reaches" in text


def test_no_filter_no_claim() -> None:
    """Where every filter failed the sentence says so."""
    error, record = found(T, SWING, 0 * T)
    text = where(replace(error, d_sd=np.full_like(error.d_sd, np.inf)), record, OSCILLATOR)
    assert "cannot be estimated" in text


def plant(effect: str, value: float, outputs: str) -> Case:
    model = replace(OSCILLATOR, outputs={name: Output(name, name) for name in outputs})
    truth = model.plus("v", effect, {"a": Parameter(value)})
    push = {"F": lambda t: float(2 * np.sin(1.7 * t) + np.sin(0.6 * t))}
    return Case("plant", "A driven mass.", model, truth, Experiment(30.0, 0.05, (0.5, 0.0), push))


@pytest.mark.parametrize("noise", [0.01, 0.05, 0.1])
@pytest.mark.parametrize(
    ("name", "low"), [("paper", 0.93), ("cubic, position alone", 0.93), ("drag, position alone", 0.93), ("dry", 0.83)]
)
def test_the_band_covers_the_true_error(name: str, low: float, noise: float) -> None:
    """About 95 % of the true d lie within 1.96 sd, averaged over records; fewer where d jumps (dry friction)."""
    case = {
        "paper": plugins.cases()["paper-cubic"],
        "cubic, position alone": plant("-a*p**3", 1.5, "p"),
        "drag, position alone": plant("-a*v*abs(v)", 0.3, "p"),
        "dry": plant("-a*tanh(v/0.02)", 0.4, "pv"),
    }[name]
    shares, sizes = [], []
    for seed in range(4):
        record, truth = case.simulate(noise, 1000 + seed)
        model = case.deficient
        fixed = replace(model, parameters={n: replace(p, fixed=True) for n, p in model.parameters.items()})
        problem = prepare(fixed, record)
        error = discrepancy(problem, problem.start)
        i = list(model.states).index(error.equation)
        shares.append(np.mean(np.abs(error.d[:, i] - truth.d[:, i]) < 1.96 * error.d_sd[:, i]))
        sizes.append(np.mean(error.d_sd[:, i]) / np.std(truth.d[:, i]))
    assert np.mean(shares) > low
    # Covering by a band as wide as d itself would be no art.
    assert np.mean(sizes) < 0.75


def test_height_orders_no_free_fall() -> None:
    """A state that no equation contains is no variable; drag is ordered by speed."""
    model = Model("ball", {"z": "v", "v": "-9.81"}, {}, outputs={"z": Output("z", "z")})
    truth = model.plus("v", "-a*v*abs(v)", {"a": Parameter(0.1)})
    case = Case("ball", "A falling ball.", model, truth, Experiment(2.0, 0.02, (30.0, 0.0)))
    record = case.simulate(0.0005, 3)[0]
    problem = prepare(model, record)
    error = discrepancy(problem, problem.start)
    assert "z" not in error.ratios
    assert error.variable == "v"
    assert axes(model, error) is None
    assert {"v", "t"} <= set(error.ratios)


def test_an_input_can_be_the_variable() -> None:
    """A gain that saturates is ordered by the input, which is a candidate as the states are."""
    case = plant("-a*max(abs(F) - 1, 0)*sign(F)", 0.8, "pv")
    record = case.simulate(0.01, 5)[0]
    problem = prepare(case.deficient, record)
    assert discrepancy(problem, problem.start).variable == "F"


def test_bins_and_cells_hold_all_samples() -> None:
    """Counts add up, an empty bin has no mean, and passages through a bin narrow its band."""
    error, record = found(T, SWING, -(SWING**3))
    b = bins(error, SWING, record, 1)
    assert b.count.sum() == 600
    assert np.isnan(b.mean[b.count == 0]).all()
    assert np.nanmax(b.sd) < 0.1
    np.testing.assert_array_equal(b.count, np.histogram(SWING, b.edges)[0])
    centre = 0.5 * (b.edges[1:] + b.edges[:-1])
    assert b.mean[[0, -1]] == pytest.approx(-(centre[[0, -1]] ** 3), rel=0.2)
    cells = state_map(OSCILLATOR, error)
    assert cells is not None
    assert (cells.x, cells.y) == ("p", "v")
    assert cells.count.sum() == 600
    assert np.isnan(cells.mean[cells.count == 0]).all()


def test_a_passage_survives_two_samples_outside_and_not_three() -> None:
    """Single samples are noise beside real passages, and all there is where there are none."""
    inside = np.array([bool(int(letter)) for letter in "0111001110001110100"])
    assert _passages(inside) == [(1, 9), (12, 17)]
    inside = np.array([bool(int(letter)) for letter in "01000000100011100"])
    assert _passages(inside) == [(12, 15)]
    assert _passages(inside[:12]) == [(1, 2), (8, 9)]
    assert _passages(np.zeros(5, dtype=bool)) == []


def test_the_three_worst_parts_are_named_with_their_run_and_times() -> None:
    """Of five parts that fail, the three largest, largest first; noise alone has none."""
    t = np.arange(400.0)
    record = Record(t, np.zeros((400, 0)), np.zeros((400, 1)), (0, 200))
    e = np.random.default_rng(1).standard_normal((400, 1))
    assert _worst(record, e) == ()
    for first, size in ((30, 6.0), (70, 9.0), (110, 5.0), (240, 12.0), (300, 7.0)):
        e[first : first + 10] += size
    assert _worst(record, e) == ((1, 240.0, 249.0), (0, 70.0, 79.0), (1, 300.0, 309.0))


@pytest.mark.parametrize("value", [0.0, 2.5])
def test_a_variable_that_never_changes_is_in_one_bin(value: float) -> None:
    """As many bins as for any variable, of a width above zero, and all samples in the first."""
    error, record = found(T, SWING, -(SWING**3))
    b = bins(error, np.full(len(T), value), record, 1)
    assert len(b.edges) == len(b.count) + 1 == len(bins(error, SWING, record, 1).edges)
    assert np.all(np.diff(b.edges) > 0)
    assert b.count.tolist() == [len(T)] + [0] * (len(b.count) - 1)
    assert np.isfinite([b.mean[0], b.sd[0]]).all()
    assert np.isnan([b.mean[1:], b.sd[1:]]).all()


@pytest.mark.parametrize("colour", [0.0, 0.7])
def test_bands_of_correlations_hold_99_percent(colour: float) -> None:
    """Of unrelated residuals and inputs about 1 % leave the band: white ones, and inputs and residuals with memory."""
    rng = np.random.default_rng(2)

    def series(N: int) -> Array:
        x = rng.standard_normal(N)
        for k in range(1, N):
            x[k] += colour * x[k - 1]
        return x

    beyond, whites, count = 0, 0, 0
    for _ in range(60):
        e, u = series(500), series(500)
        record = Record(np.arange(500.0), u[:, None], e[:, None])
        c = cross_correlation(record, e[:, None], ["y"], ["F"])["y"]["F"]
        beyond += int((np.abs(c.r) > c.band).sum())
        count += len(c.r)
        r = whiteness(record, e[:, None], ["y"])["y"]
        whites += int((np.abs(r) > BAND / np.sqrt(500)).sum())
    assert 0.002 < beyond / count < 0.025
    if colour == 0.0:
        assert 0.002 < whites / (60 * LAGS) < 0.025
    else:
        assert whites > 60


def test_an_input_that_is_left_out_is_seen_at_its_lag() -> None:
    """A residual that holds the input three samples late has its peak at lag 3, outside the band."""
    rng = np.random.default_rng(4)
    u = rng.standard_normal(400)
    e = 0.5 * np.roll(u, 3) + rng.standard_normal(400)
    c = cross_correlation(Record(np.arange(400.0), u[:, None], e[:, None]), e[:, None], ["y"], ["F"])["y"]["F"]
    assert int(c.lags[np.argmax(np.abs(c.r))]) == 3
    assert np.max(np.abs(c.r)) > 2 * c.band


def test_everything_is_data() -> None:
    """The object is JSON with consistent lengths; a long series is thinned and keeps its extremes."""
    t = np.arange(9000) * 0.01
    p = 2.0 * np.sin(2.0 * t)
    error, record = found(t, p, -(p**3), runs=2)
    error.d[4321, 1] = 50.0
    record = replace(record, u=np.cos(t)[:, None])
    compared = compare(OSCILLATOR, record, p[:, None] + 0.1, np.array([0.05]))
    told = to_json(OSCILLATOR, record, compared, error)
    json.dumps(told)
    assert len(told["bins"]["edges"]) == len(told["bins"]["d"]) + 1 == len(told["bins"]["count"]) + 1
    assert sum(len(run["t"]) for run in told["series"]) <= MOST
    assert max(max(run["d"]) for run in told["series"]) == 50.0
    assert len(told["series"]) == 2
    assert np.shape(told["map"]["d"]) == np.shape(told["map"]["count"])
    assert len(told["cross_correlation"]["r"]["p"]["F"]) == len(told["cross_correlation"]["lags"])
    assert len(told["whiteness"]["r"]["p"]) == len(told["whiteness"]["lags"])
    assert told["worst"]
