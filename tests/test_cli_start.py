"""The command line answers before anything heavy is loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("numpy", "scipy", "numba", "sympy", "pandas", "matplotlib", "pyarrow", "jinja2", "joblib", "rich", "filterpy")


@pytest.mark.parametrize("arguments", [["--help"], ["diagnose", "--help"], ["bench", "--help"]])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    """Help needs argparse alone; numerics, tables and figures are loaded inside the verbs."""
    run = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "suite", *arguments], capture_output=True, text=True, timeout=60
    )
    assert run.returncode == 0, run.stderr[-2000:]
    loaded = {line.rpartition("|")[2].strip().partition(".")[0] for line in run.stderr.splitlines() if "|" in line}
    assert "argparse" in loaded
    assert not loaded & set(HEAVY)


def test_help_names_every_verb() -> None:
    """What can be done is on the first page."""
    run = subprocess.run([sys.executable, "-m", "suite", "--help"], capture_output=True, text=True, timeout=60)
    for verb in ("example", "list", "check", "compare", "diagnose", "add", "discover", "bench"):
        assert verb in run.stdout


def test_an_unknown_verb_is_bad_input() -> None:
    """Exit code 2, and nothing on standard output."""
    run = subprocess.run([sys.executable, "-m", "suite", "frobnicate"], capture_output=True, text=True, timeout=60)
    assert run.returncode == 2
    assert run.stdout == ""
    assert "Traceback" not in run.stderr
