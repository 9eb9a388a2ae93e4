"""`unmodelled test`: the contract checks of plug-ins, built-in, from other distributions, or in a file."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from suite import plugins
from suite.case import Case
from suite.contracts import cases, effects, estimators
from suite.contracts.outcome import BrokenContractError, NotApplicableError
from suite.effect import Effect
from suite.errors import InputError
from suite.estimator import Estimator

CHECKED = ("estimators", "baselines", "cases", "effects")
SIGNS = {"passed": "ok  ", "failed": "FAIL", "not applicable": "-   "}


@dataclass(frozen=True)
class Line:
    """One check of one plug-in: "passed", "failed" or "not applicable", and what there is to say."""

    kind: str
    plug_in: str
    check: str
    outcome: str
    reason: str

    def __str__(self) -> str:
        return f"{SIGNS[self.outcome]} {self.plug_in}: {self.check}" + (f": {self.reason}" if self.reason else "")


def checks(plug_in: Estimator | Case | Effect) -> dict[str, Callable[[Any], str]]:
    """The checks of a plug-in's kind, by name."""
    if isinstance(plug_in, Estimator):
        return dict(estimators.CHECKS)
    return dict(cases.CHECKS if isinstance(plug_in, Case) else effects.CHECKS)


def tested(kind: str, name: str, plug_in: Estimator | Case | Effect) -> Iterator[Line]:
    """Every check of one plug-in; whatever the plug-in does, each ends in a line."""
    for check, holds in checks(plug_in).items():
        try:
            outcome, reason = "passed", holds(plug_in)
        except BrokenContractError as error:
            outcome, reason = "failed", str(error)
        except NotApplicableError as error:
            outcome, reason = "not applicable", str(error)
        except Exception as error:  # a plug-in may fail in any way; that is what is tested
            outcome, reason = "failed", f"{type(error).__name__}: {error}"
        yield Line(kind, name, check, outcome, " ".join(reason.split()))


def run(args: argparse.Namespace) -> int:
    """Test what is named (or everything), a line a check; 1 where one failed."""
    lines = []
    for line in _lines(args.names):
        lines.append(line)
        if not args.json:
            print(line, flush=True)
    counts = {outcome: sum(line.outcome == outcome for line in lines) for outcome in SIGNS}
    if args.json:
        print(json.dumps({**counts, "checks": [asdict(line) for line in lines]}, indent=1, ensure_ascii=False))
    else:
        print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    return int(counts["failed"] > 0)


def _lines(names: Sequence[str]) -> Iterator[Line]:
    if not names:
        names = [name for kind in CHECKED for name in (*plugins.find(kind).loaded, *plugins.find(kind).failed)]
    # What is not there is said before anything is tested.
    for entry in [entry for name in dict.fromkeys(names) for entry in _named(name)]:
        if isinstance(entry, Line):
            yield entry
        else:
            yield from tested(*entry)


def _named(name: str) -> list[Line | tuple[str, str, Any]]:
    """The plug-ins of a name or in a file, and a failed line for each that could not be loaded."""
    if name.endswith(".py"):
        return _in_file(Path(name))
    found: list[Line | tuple[str, str, Any]] = []
    for kind in CHECKED:
        if name in plugins.find(kind).loaded:
            found.append((kind, name, plugins.find(kind).loaded[name]))
    for kind in CHECKED if not found else ():
        for label, reason in plugins.find(kind).failed.items():
            if name == label or _spelled(name) in _words(label):
                found.append(Line(kind, label, "loads", "failed", reason))
    if not found:
        raise InputError(
            f"no plug-in {name!r}; `unmodelled list` names them all, a file is given by its path, such as ./{name}.py"
        )
    return found


def _spelled(name: str) -> str:
    return name.replace("-", "_")


def _words(label: str) -> set[str]:
    """What a plug-in that did not load may be called: its module, what its entry point names, the entry point."""
    value, _, point = label.partition(" (entry point ")
    return {_spelled(word) for word in (*value.replace(":", ".").split("."), *point.split()[:1])} - set(CHECKED)


def _in_file(path: Path) -> list[Line | tuple[str, str, Any]]:
    """The plug-ins of a file that is registered nowhere."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the path of a plug-in's file, or a plug-in's name")
    name = f"plug_in_{path.stem}"

    def load() -> ModuleType:
        module = ModuleType(name)
        module.__file__ = str(path)
        # Classes look for their module there.
        sys.modules[name] = module
        exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), module.__dict__)
        return module

    found = plugins.Found()
    plugins.take(found, "file", str(path), load)
    entries: list[Line | tuple[str, str, Any]] = [(plugins.kind_of(item), n, item) for n, item in found.loaded.items()]
    return entries + [Line("file", label, "loads", "failed", reason) for label, reason in found.failed.items()]
