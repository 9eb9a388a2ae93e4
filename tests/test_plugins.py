"""`unmodelled list` says what did not load and why; `unmodelled new` writes what passes `unmodelled test` at once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import suite
from suite import plugins
from suite.__main__ import main

ESTIMATOR = '''
from suite.estimator import Estimate, Estimator

class {name}(Estimator):
    """A method."""
    name = "{id}"

    def estimate(self, model, record):
        return Estimate(x=0.0 * record.t[:, None] + record.prior.x0)
'''
BROKEN = {
    "raises": ("raise RuntimeError('no licence')\n", "RuntimeError: no licence"),
    "leaves": ("raise SystemExit(3)\n", "SystemExit: 3"),
    "misspelt": ("def estimate(:\n", "SyntaxError: invalid syntax"),
    "lonely": ("import a_module_that_nobody_has\n", "No module named 'a_module_that_nobody_has'"),
    "empty": ("X = 1\n", "it holds no plug-in"),
    "unnamed": (ESTIMATOR.format(name="A", id="a").replace('name = "a"', ""), "A has no name; write name"),
    "abstract": (ESTIMATOR.format(name="B", id="b").replace("def estimate", "def calculate"), "class B lacks estimate"),
    "strange": ("from effects.outflow import EFFECT\n", "it holds an effect where an estimator belongs"),
    "twice": (ESTIMATOR.format(name="C", id="same") + ESTIMATOR.format(name="D", id="same"), "'same' is already taken"),
    "two": (ESTIMATOR.format(name="E", id="one") + ESTIMATOR.format(name="F", id="other"), ""),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of estimators is another one, with every kind of file that does not load."""
    place = tmp_path / "estimators_of_a_test"
    place.mkdir()
    (place / "__init__.py").touch()
    for name, (text, _) in BROKEN.items():
        (place / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(plugins.FOLDERS, "estimators", place.name)
    for cached in (plugins.find, plugins._own):
        cached.cache_clear()
    yield
    for cached in (plugins.find, plugins._own):
        cached.cache_clear()


@pytest.mark.usefixtures("folder")
def test_list_names_every_file_that_did_not_load_and_why(capsys: pytest.CaptureFixture[str]) -> None:
    """Each broken file has a line with its reason; the sound ones beside it are there all the same."""
    assert main(["list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["estimators"]
    for name, (_, reason) in BROKEN.items():
        if reason:
            assert reason in found["failed"].pop(f"estimators_of_a_test.{name}"), name
    assert found["failed"] == {}
    assert set(found["loaded"]) == {"same", "one", "other"}
    assert main(["list"]) == 0
    assert "not loaded: estimators_of_a_test.raises: RuntimeError: no licence" in capsys.readouterr().out


@pytest.mark.usefixtures("folder")
def test_a_plug_in_that_did_not_load_fails_its_test(capsys: pytest.CaptureFixture[str]) -> None:
    """Asked for by the name of its file it is a failed line with the reason, and the exit code is 1."""
    assert main(["test", "raises"]) == 1
    out = capsys.readouterr().out
    assert "FAIL estimators_of_a_test.raises: loads: RuntimeError: no licence" in out


@pytest.mark.parametrize("kind", ["estimator", "case", "effect"])
def test_what_new_writes_passes_its_test(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Outside a clone the file lies in the current folder and no check fails; it is never overwritten."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", kind, "my-own", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    file = tmp_path / "my_own.py"
    assert said["files"] == [str(file)]
    assert not said["registered"]
    assert "entry point" in " ".join(said["next"])
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 60
    assert main(["test", "my_own.py", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["failed"] == 0
    assert found["passed"] >= 6
    # An estimator has everything to be tested on; one effect more must not make it not applicable.
    assert found["not applicable"] == {"estimator": 0, "case": 1, "effect": 0}[kind]
    file.write_text("mine", encoding="utf-8")
    assert main(["new", kind, "my-own"]) == 2
    assert "stays as it is" in capsys.readouterr().err
    assert file.read_text(encoding="utf-8") == "mine"


def test_in_a_clone_the_place_of_the_file_registers_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From anywhere in the clone that is running, the file goes to the plug-in folder."""
    (tmp_path / "suite").mkdir()
    (tmp_path / "docs").mkdir()
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "unmodelled"\n', encoding="utf-8")
    monkeypatch.setattr(suite, "__file__", str(tmp_path / "suite" / "__init__.py"))
    monkeypatch.chdir(tmp_path / "docs")
    assert main(["new", "estimator", "my-own"]) == 0
    assert "its place registers it" in capsys.readouterr().out
    assert (tmp_path / "estimators" / "my_own.py").is_file()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("My Filter", "small letters"),
        ("3d", "small letters"),
        ("../x", "small letters"),
        ("", "small letters"),
        ("a" * 65, "small letters"),
        ("class", "taken by the language"),
        ("ekf", "there is an estimator of this name"),
        ("json", "Python has a module json"),
    ],
)
def test_a_bad_name_is_refused_in_a_sentence(
    name: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one line, nothing written."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "estimator", name]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["no-such-plug-in", "no_such_file.py"])
def test_what_is_not_there_cannot_be_tested(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and a sentence."""
    assert main(["test", "ekf", name]) == 2
    assert name in capsys.readouterr().err
