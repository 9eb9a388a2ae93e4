"""Find the plug-ins: by their file's place in a plug-in folder, then by entry point of other distributions."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from suite.case import Case
from suite.effect import Effect
from suite.estimator import Estimator
from suite.metric import Metric

KINDS = ("estimators", "baselines", "cases", "effects", "metrics")
# Metrics are of the benchmark alone, so their folder is there.
FOLDERS = {"metrics": "suite.benchmark.measures"}


@dataclass(frozen=True)
class Found:
    """The plug-ins of one kind by name, and those that could not be loaded with the reason."""

    loaded: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)


@cache
def find(kind: str) -> Found:
    """All plug-ins of a kind: "estimators" and "baselines" (instances), "cases", "effects", "metrics"."""
    found = Found()
    folder = FOLDERS.get(kind, kind)
    package = importlib.import_module(folder)
    for file in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
        # What several plug-ins share has a name with _ and is none itself.
        if not file.startswith("_"):
            _take(found, f"{folder}.{file}", lambda name=f"{folder}.{file}": importlib.import_module(name))
    for point in sorted(entry_points(group=f"unmodelled.{kind}"), key=lambda point: point.name):
        _take(found, f"{point.value} (entry point {point.name})", point.load)
    return found


def estimators() -> dict[str, Estimator]:
    """Every estimator and every baseline, by name."""
    return {**find("estimators").loaded, **find("baselines").loaded}


def cases() -> dict[str, Case]:
    """Every case, by name."""
    return dict(find("cases").loaded)


def effects() -> dict[str, Effect]:
    """Every effect, by id."""
    return dict(find("effects").loaded)


def metrics() -> dict[str, Metric]:
    """Every metric of the benchmark that is a plug-in, by name."""
    return dict(find("metrics").loaded)


def _take(found: Found, label: str, load: Any) -> None:
    try:
        items = {item.id if isinstance(item, Effect) else item.name: item for item in _items(load())}
    except Exception as error:  # a plug-in may fail in any way; the others must still run
        found.failed[label] = f"{type(error).__name__}: {error}"
        return
    for name, item in items.items():
        if name in found.loaded:
            found.failed[label] = f"the name {name!r} is already taken"
        else:
            found.loaded[name] = item


def _items(thing: Any) -> Iterator[Any]:
    """The plug-ins in a module, or the one that an entry point names."""
    for value in vars(thing).values() if isinstance(thing, ModuleType) else [thing]:
        if isinstance(value, (Case, Effect, Metric)):
            yield value
        elif inspect.isclass(value) and issubclass(value, Estimator) and not inspect.isabstract(value):
            # A class that a module imports from another is that one's plug-in.
            imported = isinstance(thing, ModuleType) and value.__module__ != thing.__name__
            if not imported:
                yield value()
