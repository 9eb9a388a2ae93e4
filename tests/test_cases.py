"""Every case is one short file, repeats itself exactly, and says where its data are when they are not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cases
from cases.whiffle_ball import SOURCE
from suite import plugins
from suite.case import Case, Experiment
from suite.errors import DataError
from suite.model import Model, Output, Parameter
from suite.record import Record

FILES = sorted(Path(cases.__path__[0]).glob("[!_]*.py"))
WITH_TRUTH = [name for name, case in plugins.cases().items() if case.truth is not None]
# Plants of tens of states are run once, and their equations compared as text.
LARGE = [name for name in WITH_TRUTH if "large" in plugins.cases()[name].tags]
SIMULATED = [name for name in WITH_TRUTH if name not in LARGE]
NULL = [name for name in SIMULATED if "null" in plugins.cases()[name].tags]
LACKING = [name for name in SIMULATED if name not in NULL]
# The plants that the benchmark promises, and what their models lack (a wrong parameter, and
# nothing at all in a twin, are no effect).
PROMISED = {
    "paper-cubic": {"cubic_stiffness"},
    "paper-terms": {"viscous_damping", "linear_stiffness", "cubic_stiffness"},
    "paper-cubic-discrete": {"cubic_stiffness"},
    "duffing": {"cubic_stiffness"},
    "van-der-pol-wsindy": {"nonlinear_damping"},
    "pendulum-dry-friction": {"coulomb_friction"},
    "pendulum-drag": {"quadratic_drag"},
    "stribeck-joint": {"stribeck_friction"},
    "dc-motor-backlash": {"backlash"},
    "quarter-car-bump-stop": {"hard_stop"},
    "two-masses-cubic": {"cubic_stiffness"},
    "flexible-structure": {"cubic_stiffness"},
    "robot-arm": {"coulomb_friction"},
    "aircraft-short-period": {"cubic_term"},
    "phugoid-mach-drag": {"mach_drag"},
    "satellite-gravity-gradient": {"gravity_gradient"},
    "reentry": set(),
    "tank-second-outlet": {"outflow"},
    "heated-body": {"radiation"},
    "reactor-heat": {"heat_of_reaction"},
    "predator-prey": {"self_limitation"},
    "battery-hysteresis": {"voltage_hysteresis"},
    "lorenz-product": {"product_coupling"},
    "lorenz-96": {"cubic_term"},
    "chain-of-masses": {"cubic_stiffness"},
    "lorenz-twin": set(),
}
STATES = {"flexible-structure": 20, "lorenz-96": 40, "chain-of-masses": 200}
MEASURED = [name for name, case in plugins.cases().items() if case.measured is not None]


def test_every_case_loads() -> None:
    """No file of the folder fails to give its case."""
    assert plugins.find("cases").failed == {}
    assert len(plugins.cases()) >= len(FILES)


def test_a_private_file_is_no_plug_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file whose name starts with _ is not even imported."""
    text = "from suite import plugins\nEFFECT = plugins.effects()['cubic_stiffness']\n"
    folder = tmp_path / "a_folder_of_plug_ins"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "one.py").write_text(text, encoding="utf-8")
    (folder / "_shared.py").write_text("raise ImportError('private')\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    found = plugins.find(folder.name)
    assert (list(found.loaded), found.failed) == (["cubic_stiffness"], {})


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_case_is_at_most_40_lines(path: Path) -> None:
    """A case fits on one screen."""
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 40


@pytest.mark.parametrize("name", SIMULATED)
def test_the_seed_fixes_every_number(name: str) -> None:
    """The same seed gives the same record; another seed gives other noise on the same truth."""
    case = plugins.cases()[name]
    first, truth = case.simulate(0.05, 7)
    again, _ = case.simulate(0.05, 7)
    other, same = case.simulate(0.05, 8)
    np.testing.assert_array_equal(first.y, again.y)
    np.testing.assert_array_equal(truth.x, same.x)
    assert np.all(np.nanstd(first.y - other.y, axis=0) > 0)


@pytest.mark.parametrize("name", LACKING)
def test_the_model_error_is_the_missing_terms(name: str) -> None:
    """True rate = deficient rate + d, and d acts only where the case says that something is missing."""
    case = plugins.cases()[name]
    assert case.truth is not None
    record, truth = case.simulate(0.0, 0)
    hit = {missing.equation for missing in case.missing}
    assert hit
    assert hit <= {*case.deficient.states, *case.deficient.outputs, *case.deficient.inputs}
    if list(case.truth.states) == list(case.deficient.states):
        for k in range(0, len(record), 40):
            gap = case.truth.rate(record.t[k], truth.x[k], record.u[k]) - truth.d[k]
            wanted = case.deficient.rate(record.t[k], truth.x[k], record.u[k])
            np.testing.assert_allclose(gap, wanted, rtol=1e-9, atol=1e-12)
    if any(missing.effect == "transfer" for missing in case.missing):
        # What enters one store leaves another.
        hit |= {state for i, state in enumerate(case.deficient.states) if np.any(truth.d[:, i] < 0)}
        np.testing.assert_allclose(truth.d.sum(axis=1), 0.0, atol=1e-12)
    if not hit & set(case.deficient.inputs):
        for i, state in enumerate(case.deficient.states):
            assert bool(np.any(truth.d[:, i] != 0)) == (state in hit)


@pytest.mark.parametrize("name", NULL)
def test_a_null_case_lacks_nothing(name: str) -> None:
    """With the true parameters (which only a case tagged so gets wrong) the model error of a null case is zero."""
    case = plugins.cases()[name]
    assert case.truth is not None
    assert case.missing == ()
    right = case.deficient.with_values({n: p.value for n, p in case.truth.parameters.items()})
    assert (right == case.deficient) == ("wrong-parameter" not in case.tags)
    assert not np.any(replace(case, deficient=right).simulate(0.0, 0)[1].d)


@pytest.mark.parametrize("name", LACKING)
def test_what_is_missing_is_visible(name: str) -> None:
    """The deficient model's free run misses a measurement by more than three times the 1 % noise; the plant is finite.

    The runs start from the true first state with the file's parameters.
    """
    case = plugins.cases()[name]
    record, truth = case.simulate(0.01, 0)
    assert np.all(np.isfinite(truth.x))
    errors = np.abs(_free_run(case).y - case.simulate(0.0, 0)[0].y)
    assert np.any(np.sqrt(np.nanmean(errors**2, axis=0)) > 3 * truth.noise)
    assert 150 <= len(record) <= (5001 if {"published", "chaotic"} & set(case.tags) else 1001)


def _free_run(case: Case) -> Record:
    """What the sensors would read if the deficient model were the plant."""
    assert case.truth is not None
    assert case.experiment is not None
    first = dict(zip(case.truth.states, case.experiment.x0, strict=True))
    start = tuple(first[name] for name in case.deficient.states)
    return replace(case, truth=case.deficient, experiment=replace(case.experiment, x0=start)).simulate(0.0, 0)[0]


@pytest.mark.parametrize("name", WITH_TRUTH)
def test_a_known_first_state_is_the_true_one(name: str) -> None:
    """A first state that the model calls known is where the plant starts; every tag is a word; parameters say how well
    they are known.
    """
    case = plugins.cases()[name]
    assert case.truth is not None
    assert case.experiment is not None
    first = dict(zip(case.truth.states, case.experiment.x0, strict=True))
    for state, initial in case.deficient.initial.items():
        assert initial.estimate or initial.value == first[state]
    assert case.tags
    assert list(case.truth.outputs) == list(case.deficient.outputs)
    assert list(case.truth.inputs) == list(case.deficient.inputs) == list(case.experiment.inputs)
    for missing in case.missing:
        for parameter, value in missing.coefficients.items():
            assert case.truth.parameters[parameter].value == value


@pytest.mark.parametrize("name", LARGE)
def test_a_large_case_differs_in_its_missing_terms(name: str) -> None:
    """Of a case too large to compile here, truth and model differ in the named equations and in no other."""
    case = plugins.cases()[name]
    assert case.truth is not None
    pairs = zip(case.deficient.states, case.deficient.rates, case.truth.rates, strict=True)
    assert {state for state, model, truth in pairs if model != truth} == {m.equation for m in case.missing}


@pytest.mark.parametrize("name", LARGE)
def test_a_large_case_runs(name: str) -> None:
    """It is as large as it is said to be, stays finite, and errs where its term acts and nowhere else."""
    case = plugins.cases()[name]
    record, truth = case.simulate(0.01, 0)
    assert len(case.deficient.states) == STATES[name]
    assert np.all(np.isfinite(truth.x))
    assert np.isfinite(record.y).any()
    hit = {missing.equation for missing in case.missing}
    assert {state for state, d in zip(case.deficient.states, truth.d.T, strict=True) if np.any(d != 0)} == hit


@pytest.mark.parametrize("name", PROMISED)
def test_the_promised_plants_lack_what_they_say(name: str) -> None:
    """Each plant of the benchmark is there, with the effects that its model lacks."""
    assert {missing.effect for missing in plugins.cases()[name].missing} == PROMISED[name]


def test_a_plant_may_have_a_state_that_its_model_lacks() -> None:
    """The truth's own state is integrated with the others and kept from the record's truth: x' = z, z' = -x in turn."""
    model = Model("x", {"x": "-x"}, outputs={"x": Output("x", column="x")})
    plant = replace(model, states={"z": "-x", "x": "z"})
    case = Case("turning", "", model, plant, Experiment(6.0, 0.05, (1.0, 0.0), every={"x": 4}))
    record, truth = case.simulate(0.0, 0)
    np.testing.assert_allclose(truth.x[:, 0], np.sin(record.t), atol=1e-9)
    np.testing.assert_allclose(truth.d[:, 0], np.cos(record.t) + np.sin(record.t), atol=1e-9)
    seen = np.flatnonzero(~np.isnan(record.y[:, 0]))
    np.testing.assert_array_equal(seen, np.arange(4, len(record), 4))


def test_a_held_model_error_carries_the_plant() -> None:
    """The deficient model pushed by the held d over each sample lands on the next true state of the held case."""
    case = plugins.cases()["paper-cubic-discrete"]
    record, truth = case.simulate(0.0, 0)
    pushed = replace(case.deficient, initial={})
    for k in (0, 100, 200):
        push = {"push": Parameter(float(truth.d[k, 0]))}
        step = pushed.plus("x1", "+push", push).step(record.t[k], truth.x[k], record.u[k], 0.05, record.u[k + 1])
        np.testing.assert_allclose(step, truth.x[k + 1], atol=1e-8)


@pytest.mark.parametrize("name", MEASURED)
def test_a_measured_record_fits_its_model(name: str) -> None:
    """A measured case has a column for every output of its model."""
    case = plugins.cases()[name]
    assert case.measured is not None
    try:
        record = case.measured(None)
    except DataError as error:
        pytest.skip(str(error))
    assert record.y.shape[1] == len(case.deficient.outputs)
    assert record.u.shape[1] == len(case.deficient.inputs)


def test_absent_data_are_said_with_their_source_and_checksum(tmp_path: Path) -> None:
    """Without its files a measured case says where to get them and how to know that they are right."""
    case = plugins.cases()["whiffle-ball"]
    assert case.measured is not None
    with pytest.raises(DataError, match=r"github.com/briandesilva.*sha256 [0-9a-f]{64}"):
        case.measured(tmp_path)


def test_a_changed_file_is_refused(tmp_path: Path) -> None:
    """A file whose checksum differs is not read."""
    (tmp_path / SOURCE.folder).mkdir()
    for name in SOURCE.sha256:
        (tmp_path / SOURCE.folder / name).write_text("t,height\n0,1\n1,2\n")
    case = plugins.cases()["whiffle-ball"]
    assert case.measured is not None
    with pytest.raises(DataError, match="the file differs"):
        case.measured(tmp_path)
