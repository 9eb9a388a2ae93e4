"""Which files of a fleet are judged again, and which stay as they are stored; two runs at once share them."""

from __future__ import annotations

import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from suite.benchmark import pool
from suite.benchmark.driving import Driving
from suite.benchmark.store import Store
from suite.benchmark.worker import Failure, Task
from suite.errors import InputError
from suite.fleet import files, one
from suite.fleet import run as fleet
from suite.model import Model
from suite.model_file import read_model


class Here:
    """Stands in for the processes: each file is judged at once, in words that need no numerics.

    `seen` counts the files judged; `failing` gives what becomes of a file instead, `meanwhile` is done at each.
    """

    def __init__(self) -> None:
        self.seen: Counter[str] = Counter()
        self.failing: dict[str, Failure] = {}
        self.meanwhile: Callable[[Path], None] = lambda path: None

    def run(self, tasks: Iterable[Task | None], jobs: int, limit: float, memory: float) -> Iterator[tuple[Task, Any]]:
        for task in tasks:
            if task is None:
                time.sleep(0.01)
                continue
            path = Path(task.label)
            row = {**dict.fromkeys(one.TEXTS, ""), "status": "ok", "reason": "", "digest": one.digest(str(path))}
            self.seen[path.name] += 1
            self.meanwhile(path)
            yield task, self.failing.get(path.name, {**row, "verdict": "adequate", "weight": 0.0, "ratio": 1.0})


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Here:
    stand_in = Here()
    monkeypatch.setattr(pool, "run", stand_in.run)
    return stand_in


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    paths = [tmp_path / f"{name}.csv" for name in "abc"]
    for path in paths:
        path.write_text(f"of {path.name}")
    return paths


@pytest.fixture
def model() -> Model:
    return read_model(Path(__file__).with_name("decay.toml"))


def judge(paths: Iterable[Path], model: Model, limit: float = 10.0, **more: Any) -> tuple[int, int]:
    """How many files were run and how many were unchanged; the store is beside the files."""
    paths = list(paths)
    asked = fleet.Asked(model, "model.toml", more.pop("absolute", False))
    with Store(paths[0].parent / "fleet.sqlite", elsewhere="name another folder with -o") as store:
        ended = fleet.run(files.chosen(list(map(str, paths))), asked, store, Driving(1, limit, quiet=True, **more))
    assert sorted(brief.file for brief in ended.briefs) == sorted(map(str, paths))
    return ended.run, ended.unchanged


def test_only_what_has_changed_is_judged_again(here: Here, logs: list[Path], model: Model) -> None:
    """Other bytes, another model, other options: again. The same bytes at another time: not."""
    assert judge(logs, model) == (3, 0)
    assert judge(logs, model) == (0, 3)
    os.utime(logs[0], (1.0, 1.0))
    logs[1].write_text("changed")
    assert judge(logs, model) == (1, 2)
    assert here.seen == {"a.csv": 1, "b.csv": 2, "c.csv": 1}
    assert judge(logs[:2], model) == (0, 2)
    other = replace(model, parameters={**model.parameters, "k": replace(model.parameters["k"], value=5.0)})
    assert judge(logs, other) == (3, 0)
    assert judge(logs, other, absolute=True) == (3, 0)
    assert judge(logs, other, absolute=True, force=True) == (3, 0)
    logs[2].unlink()
    assert judge(logs, other, absolute=True) == (1, 2)


def test_a_file_that_met_a_limit_is_judged_again_under_a_wider_one(here: Here, logs: list[Path], model: Model) -> None:
    """Not under the same or a narrower one; nor once it has a verdict."""
    here.failing["b.csv"] = Failure("time-out", "not done after 10 s")
    assert judge(logs, model) == (3, 0)
    assert judge(logs, model) == (0, 3)
    assert judge(logs, model, limit=5.0) == (0, 3)
    assert judge(logs, model, memory=2000.0) == (1, 2)
    del here.failing["b.csv"]
    assert judge(logs, model, limit=20.0) == (1, 2)
    assert judge(logs, model, limit=40.0) == (0, 3)


def test_a_file_that_was_written_to_while_it_was_judged_is_judged_again(
    here: Here, logs: list[Path], model: Model
) -> None:
    """The row is that of what was read, and the next run sees that this is no more what is there."""
    here.meanwhile = lambda path: _append(path) if path.name == "b.csv" else None
    assert judge(logs, model) == (3, 0)
    here.meanwhile = lambda path: None
    assert judge(logs, model) == (1, 2)
    assert judge(logs, model) == (0, 3)


def _append(path: Path) -> None:
    path.write_text(path.read_text() + "more")


def test_two_runs_at_once_share_the_files(here: Here, tmp_path: Path, model: Model) -> None:
    """Each file is judged once, by either run, and both end with all of them."""
    paths = [tmp_path / f"{k}.csv" for k in range(40)]
    for path in paths:
        path.write_text(path.name)
    here.meanwhile = lambda path: time.sleep(0.01)
    ended: list[tuple[int, int]] = []
    both = [threading.Thread(target=lambda: ended.append(judge(paths, model))) for _ in range(2)]
    for run in both:
        run.start()
    for run in both:
        run.join()
    assert sum(run for run, _ in ended) == 40
    assert min(run for run, _ in ended) > 0
    assert set(here.seen.values()) == {1}


def test_a_run_with_another_model_on_the_same_folder_is_said(here: Here, logs: list[Path], model: Model) -> None:
    """Its verdicts replace ours while we run: a sentence, and no table of two models."""
    other = replace(model, parameters={**model.parameters, "k": replace(model.parameters["k"], value=5.0)})

    def meanwhile(path: Path) -> None:
        here.meanwhile = lambda path: None
        judge(logs, other)

    judge(logs[:1], model)
    here.meanwhile = meanwhile
    with pytest.raises(InputError, match="another model or other options; name another folder with -o"):
        judge(logs, model)
