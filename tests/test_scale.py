"""Very long records: read in pieces, fitted to an excerpt, judged on all samples, in memory that does not grow."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from suite import plugins
from suite.discovery import misfit, whole
from suite.discovery.excerpt import cut, excerpt
from suite.discovery.fit import prepare
from suite.discovery.frame import Point
from suite.discovery.verdict import diagnose
from suite.discovery.whole import pieces, survey
from suite.model import Initial, Input, Model, Output, Parameter
from suite.record import Record, join

Array = npt.NDArray[np.float64]
EFFECTS = plugins.effects()
TANK = Model(
    "tank",
    {"x": "u - k*x"},
    parameters={"k": Parameter(2.0, sd=0.2)},
    inputs={"u": Input("u")},
    outputs={"y": Output("x", "y", sigma=0.01)},
    initial={"x": Initial(0.0)},
)


def measured(samples: int, seed: int = 0, start: float = 0.0, uneven: float = 0.0) -> Record:
    """A tank as its model says, driven by steps of twenty samples."""
    rng = np.random.default_rng(seed)
    dt = 0.05 * (1.0 + uneven * rng.uniform(-1.0, 1.0, samples))
    u = np.repeat(rng.standard_normal(samples // 20 + 1), 20)[:samples]
    x = np.zeros(samples)
    for k in range(samples - 1):
        fade = np.exp(-2.0 * dt[k])
        x[k + 1] = fade * x[k] + (1.0 - fade) / 2.0 * u[k]
    t = start + np.concatenate([[0.0], np.cumsum(dt[:-1])])
    y = x + 0.01 * rng.standard_normal(samples)
    return Record(t, u[:, None], y[:, None], source=f"tank{seed}.csv", names=(f"tank{seed}.csv",))


def direct(model: Model, record: Record) -> Array:
    """Measured minus the simulation of each run in one pass, (N, outputs)."""
    left = []
    for run in record.runs:
        problem = prepare(misfit.frozen(model), run.part(0, 500))
        point = Point(np.array([[model.initial["x"].value]]), model.values)
        left.append(run.y - problem.on(run, point).run(point, 0.0).Y)
    return np.concatenate(left)


@pytest.mark.parametrize("delay", [0.0, 0.7])
def test_a_simulation_in_chunks_is_the_whole_one(monkeypatch: pytest.MonkeyPatch, delay: float) -> None:
    """Several runs, uneven steps, missing samples, an input that acts later: the same sums, to rounding."""
    monkeypatch.setattr(whole, "CHUNK", 700)
    monkeypatch.setattr(whole, "PIECE", 300)
    model = TANK
    if delay:
        parameters = {**TANK.parameters, "late": Parameter(delay, fixed=True)}
        model = replace(TANK, parameters=parameters, inputs={"u": Input("u", "linear", "late")})
    record = join([measured(3000, 1, uneven=0.5), measured(2100, 2, start=7.0, uneven=0.5)])
    y = record.y.copy()
    y[::7] = np.nan
    y[1400:1700] = np.nan
    record = replace(record, y=y)
    problem = prepare(misfit.frozen(model), record.part(0, 300))
    found = survey(problem, model.values, (), record, length=300)
    left = direct(model, record)
    np.testing.assert_allclose(found.error, np.sqrt(np.nanmean(left**2, axis=0)), rtol=1e-12)
    for first, last, square, count in zip(found.first, found.last, found.square, found.count, strict=True):
        part = left[first:last]
        assert count == np.isfinite(part).sum()
        if count:
            assert square == pytest.approx(np.nanmean(part**2) / problem.R[0], rel=1e-9)
    assert found.count.sum() == np.isfinite(y).sum()


def test_pieces_cover_every_sample_once() -> None:
    record = join([measured(1000, 1), measured(90, 2), measured(640, 3)])
    first, last = pieces(record, 100)
    assert (first[1:] == last[:-1]).all()
    assert first[0] == 0
    assert last[-1] == len(record)
    assert {0, 1000, 1090} <= set(first.tolist())
    assert ((last - first)[:-1] >= 50).all()
    assert (last - first).max() < 150


def test_a_stretch_in_which_alone_the_model_fails_is_in_the_excerpt() -> None:
    """Ninety of 40,000 samples: pieces spread evenly would miss them."""
    record = measured(40_000)
    y = record.y.copy()
    y[23_310:23_400] += 0.3
    record = replace(record, y=y)
    part = excerpt(TANK, record, longest=10_000, length=200)
    assert part.whole is not None
    assert part.whole.record is record
    assert len(part) < 10_000
    inside = np.isin(record.t[23_310:23_400], part.t)
    assert inside.all()
    bare = excerpt(TANK, replace(record, y=measured(40_000).y), longest=10_000, length=200)
    assert not np.isin(record.t[23_310:23_400], bare.t).all()
    for (a, b), first in zip(zip(part.bounds[:-1], part.bounds[1:], strict=True), part.whole.first, strict=True):
        np.testing.assert_array_equal(part.t[a:b], record.t[first : first + b - a])
        np.testing.assert_array_equal(part.y[a:b], record.y[first : first + b - a])


def test_a_record_that_is_not_very_long_stays_whole() -> None:
    record = measured(5000)
    assert excerpt(TANK, record) is record
    part = excerpt(TANK, record, longest=4000, length=100)
    assert excerpt(TANK, part, longest=1000) is part


def test_comparing_with_an_excerpt_tells_the_error_of_all_samples() -> None:
    record = join([measured(6000, 4), measured(5000, 5)])
    model = TANK.with_values({"k": 2.1})
    part = excerpt(misfit.frozen(model), record, longest=5000, length=100)
    found = misfit.compare(model, part)
    left = direct(model, record)
    assert found.error["y"] == pytest.approx(float(np.sqrt(np.mean(left**2))), rel=1e-9)
    assert found.over_all
    assert found.Y.shape == part.y.shape
    # The intervals are of the pieces, which are runs of their own.
    run, first, last = found.worst[0]
    there = (part.t >= first) & (part.t <= last) & (np.repeat(np.arange(len(part.starts)), np.diff(part.bounds)) == run)
    assert there.any()
    told = re.search(r"the worst part is t = (\S+) to (\S+) of run (\d)\.", found.sentence)
    assert told is not None
    inside = (record.t > float(told[1]) - 1) & (record.t < float(told[2]) + 1)
    inside &= np.arange(len(record)) // 6000 == int(told[3]) - 1
    assert np.mean(left[inside] ** 2) > 1.2 * np.mean(left**2)


def test_the_excerpt_of_a_hardening_spring_tells_what_the_whole_record_does() -> None:
    """12,000 samples: the same effect, each coefficient within two bands of the other; errors are of all samples."""
    case = plugins.cases()["duffing"]
    assert case.experiment is not None
    case = replace(case, experiment=replace(case.experiment, duration=1200.0))
    record = case.simulate(0.05, 1)[0]
    effects = {name: EFFECTS[name] for name in ("cubic_stiffness", "quadratic_stiffness", "coulomb_friction")}
    part = excerpt(case.deficient, record, longest=8000, length=200)
    assert len(part) < 0.6 * len(record)
    once, other = diagnose(case.deficient, record, effects), diagnose(case.deficient, part, effects)
    assert [(e.effect, e.equation) for e in once.effects] == [(e.effect, e.equation) for e in other.effects]
    one, two = once.effects[0].coefficients["a"], other.effects[0].coefficients["a"]
    assert abs(one.value - two.value) < 3.0 * two.sd
    assert two.sd < 3.0 * one.sd
    # The parts of 1 % that differ are the fits', not the samples'.
    assert other.error["after"]["pos"] == pytest.approx(once.error["after"]["pos"], rel=0.02)
    assert other.error["before"]["pos"] == pytest.approx(once.error["before"]["pos"], rel=0.1)
    assert other.error["whole"]["after"] == other.error["after"]
    said = [sentence for sentence in other.advice if f"{len(record)} samples" in sentence]
    assert len(said) == 1
    assert f"{len(part)} of them" in said[0]
    assert not any("samples: what is fitted" in sentence for sentence in once.advice)


def test_a_plant_that_forgets_its_start_is_judged_in_its_pieces() -> None:
    """Lorenz-63: no simulation spans the record, and the verdict says so."""
    case = plugins.cases()["null-lorenz"]
    assert case.experiment is not None
    case = replace(case, experiment=replace(case.experiment, duration=60.0))
    record = case.simulate(0.01, 1)[0]
    first, last = pieces(record, 700)
    part = cut(record, first[:3], last[:3], 700)
    effects = {name: EFFECTS[name] for name in ("cubic_term", "absolute_term")}
    verdict = diagnose(case.deficient, part, effects)
    assert verdict.verdict == "adequate"
    assert "whole" not in verdict.error
    assert any("no simulation spans the record" in sentence for sentence in verdict.advice)


READ = """
import json, resource, sys
import pandas
from suite.model_file import read_model
from suite.readers import read_record
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
model = read_model(sys.argv[1])
read_record(sys.argv[2], model)
before = peak()
record = read_record(sys.argv[3], model)
print(json.dumps([before, peak(), len(record), float(record.y[-1, 0])]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no getrusage")
def test_reading_takes_memory_for_the_numbers_alone(tmp_path: Path) -> None:
    """A million rows of 60 MB with columns of text beside them: as much as four times the three columns at most."""
    rows = 1_000_000
    line = ",0.25,some words that no one asked for,{},9\n"
    block = "".join(f"{k:06d}{line.format(k % 1000)}" for k in range(1000))
    with (tmp_path / "long.csv").open("w") as handle:
        handle.write("t,u,note,y,other\n")
        for thousand in range(rows // 1000):
            handle.write(block.replace("\n000", f"\n{thousand:03d}").replace("000", f"{thousand:03d}", 1))
    (tmp_path / "short.csv").write_text("t,u,note,y,other\n0,1,a,2,9\n1,1,b,2,9\n")
    (tmp_path / "model.toml").write_text(
        '[states]\nx = "u - x"\n[inputs]\nu = { column = "u" }\n[outputs]\ny = { equation = "x", column = "y" }\n'
    )
    names = [str(tmp_path / name) for name in ("model.toml", "short.csv", "long.csv")]
    done = subprocess.run([sys.executable, "-c", READ, *names], capture_output=True, text=True, check=True)
    before, peak, count, last = json.loads(done.stdout)
    assert (count, last) == (rows, 999.0)
    assert peak - before < 4 * 3 * 8 * rows + 64e6
