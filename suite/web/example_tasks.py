"""Ready models and data to start from, as the command `example` writes them."""

from __future__ import annotations

import contextlib
import io
import json
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from suite import plugins, verbs
from suite.errors import InputError
from suite.web.payloads import text

Tell = Callable[[str], None]

# Measured ones first; those whose data are not here are left out.
SHOWN = (
    "mug", "paper", "whiffle", "pendulum-dry-friction", "duffing", "tank-second-outlet", "predator-prey",
    "slider-friction", "null-oscillator",
)  # fmt: skip


def examples(tell: Tell) -> str:
    """The examples whose data are here, each with its sentence."""
    cases = plugins.cases()
    found = []
    for name in SHOWN:
        case = cases.get(verbs.ALIASES.get(name, name))
        if case is None:
            continue
        try:
            if case.measured is not None:
                case.measured(None)
        except InputError:
            continue
        found.append({"name": name, "sentence": case.sentence})
    return text({"examples": found})


def example(name: str, folder: str, tell: Tell) -> str:
    """Write an example into a folder of the server's; the model's text, the data files and the sentence."""
    if name not in SHOWN:
        raise InputError(f"no example {name!r:.60}; choose one of {', '.join(SHOWN)}")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        verbs.example(Namespace(name=name, folder=Path(folder), noise=0.05, seed=1, data=None, json=True))
    written = json.loads(said.getvalue())
    source, *data = written["files"]
    numbers = [""] if len(data) == 1 else [str(k + 1) for k in range(len(data))]
    return text(
        {
            "model": Path(source).read_text(encoding="utf-8"),
            "files": [[path, f"{name}{number}.csv"] for path, number in zip(data, numbers, strict=True)],
            "sentence": written["sentence"],
        }
    )
