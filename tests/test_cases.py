"""Every case is one short file, repeats itself exactly, and says where its data are when they are not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cases
from cases.whiffle_ball import SOURCE
from suite import plugins
from suite.errors import DataError
from suite.model import Parameter

FILES = sorted(Path(cases.__path__[0]).glob("[!_]*.py"))
SIMULATED = [name for name, case in plugins.cases().items() if case.truth is not None]
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
    assert np.all(np.std(first.y - other.y, axis=0) > 0)


@pytest.mark.parametrize("name", SIMULATED)
def test_the_model_error_is_the_missing_terms(name: str) -> None:
    """True rate = deficient rate + d, and d acts only where the case says that something is missing."""
    case = plugins.cases()[name]
    assert case.truth is not None
    record, truth = case.simulate(0.0, 0)
    for k in range(0, len(record), 40):
        gap = case.truth.rate(record.t[k], truth.x[k], record.u[k]) - truth.d[k]
        np.testing.assert_allclose(gap, case.deficient.rate(record.t[k], truth.x[k], record.u[k]), atol=1e-12)
    hit = {missing.equation for missing in case.missing}
    for i, state in enumerate(case.deficient.states):
        assert bool(np.any(truth.d[:, i] != 0)) == (state in hit)


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
