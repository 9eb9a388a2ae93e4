"""The verbs of the workbench, from the command line: one object out, one sentence where the input is bad."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from suite.__main__ import main
from suite.tables import write_csv

MODEL = """[states]
p = "v"
v = "-c*v - k*p"
[parameters]
c = { value = 0.3, sd = 0.03 }
k = { value = 4.0, sd = 0.2 }
[outputs]
pos = "p"
[initial]
p = 2.0
v = 0.0
"""


@pytest.fixture
def plant(tmp_path: Path) -> tuple[str, str]:
    """A model file of an oscillator, and 120 noisy samples of one with a constant push."""
    t = np.linspace(0.0, 9.0, 120)
    w = math.sqrt(4.0 - 0.15**2)
    y = 0.25 + 1.75 * np.exp(-0.15 * t) * (np.cos(w * t) + 0.15 / w * np.sin(w * t))
    y = y + 0.01 * np.random.default_rng(3).standard_normal(120)
    (tmp_path / "model.toml").write_text(MODEL)
    write_csv(tmp_path / "data.csv", {"t": t, "pos": y})
    return str(tmp_path / "model.toml"), str(tmp_path / "data.csv")


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence with which a command is refused."""
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("unmodelled: ")
    assert said.err.count("\n") == 1
    return said.err


@pytest.mark.parametrize("verb", ["check", "compare", "diagnose", "discover", "add", "list", "example"])
def test_json_is_one_object_alone_on_standard_output(
    verb: str, plant: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 0, and standard output parses as one object without NaN."""
    folder = str(tmp_path / "found")
    arguments = {
        "discover": [*plant, "-o", folder],
        "add": [plant[0], "constant_force", "--data", plant[1], "-o", str(tmp_path / "new.toml")],
        "list": [],
        "example": ["paper", folder],
    }.get(verb, list(plant))
    assert main([verb, *arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
    assert isinstance(found, dict)
    if verb in ("diagnose", "discover"):
        assert (found["schema"], found["verdict"]) == (1, "missing_effect")
        assert [e["effect"] for e in found["effects"]] == ["constant_force"]


@pytest.mark.parametrize("verb", ["check", "compare", "diagnose"])
def test_files_that_are_not_there_are_refused(
    verb: str, plant: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No such model, no such data, a folder as data, no outputs: exit code 2 and a sentence."""
    assert "no such file" in refused([verb, str(tmp_path / "nope.toml"), plant[1]], capsys)
    assert "no such file" in refused([verb, plant[0], str(tmp_path / "nope.csv")], capsys)
    assert "is a folder" in refused([verb, plant[0], str(tmp_path)], capsys)
    (tmp_path / "blind.toml").write_text(MODEL.replace('pos = "p"', ""))
    assert "no outputs" in refused([verb, str(tmp_path / "blind.toml"), plant[1]], capsys)


def test_a_place_that_cannot_be_written_is_refused_before_the_search(
    plant: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """`discover -o` on a regular file: nothing is computed first, so no progress is told."""
    assert "is a file, not a folder" in refused(["discover", *plant, "-o", plant[1]], capsys)
    assert "is a file, not a folder" in refused(["example", "paper", plant[1]], capsys)
    assert "cannot be written" in refused(["discover", *plant, "-o", plant[1] + "/below"], capsys)


def test_add_refuses_what_it_cannot_place(
    plant: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An effect that is misspelt, an equation that is none, a role that nothing plays: refused, and no file written."""
    new = tmp_path / "new.toml"
    for effect, equation, words in (
        ("constant_forse", "v", "did you mean constant_force"),
        ("constant_force", "q", "nothing is called that"),
        ("cubic_stiffness", "p", "no role"),
    ):
        assert words in refused(["add", plant[0], effect, "--equation", equation, "-o", str(new)], capsys)
    assert not new.exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--seed", "-1"), ("--noise", "-1"), ("--noise", "nan"), ("--noise", "inf")]
)
def test_an_example_refuses_numbers_that_make_no_sense(
    option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A negative seed or noise is bad input, not a traceback."""
    assert option in refused(["example", "paper", str(tmp_path / "x"), option, value], capsys)


@pytest.mark.skipif(os.name == "nt", reason="SIGINT as a terminal sends it is POSIX")
def test_an_interrupt_ends_with_130_and_leaves_no_half_file(plant: tuple[str, str], tmp_path: Path) -> None:
    """Ctrl-C during discover: one sentence, exit code 130, no temporary files."""
    folder = tmp_path / "found"
    run = subprocess.Popen(
        [sys.executable, "-m", "suite", "discover", *plant, "-o", str(folder)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    for _ in range(600):
        if folder.exists() or run.poll() is not None:
            break
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 130, err
    assert out == ""
    assert "Traceback" not in err
    assert not list(folder.rglob("*.tmp"))


def test_an_effect_with_a_state_of_its_own_is_fitted_when_it_is_added(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second compartment does not stay at zero, where it started: the error falls to the noise."""
    folder = tmp_path / "drug"
    assert main(["example", "drug-second-compartment", str(folder)]) == 0
    model, data, new = str(folder / "model.toml"), str(folder / "data.csv"), str(folder / "new.toml")
    assert main(["add", model, "second_compartment", "--equation", "c", "--data", data, "-o", new]) == 0
    capsys.readouterr()
    assert main(["compare", new, data, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["error"]["c"] < 1.2 * said["noise"]["c"]
