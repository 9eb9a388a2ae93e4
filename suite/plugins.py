"""Find the plug-ins: by their file's place in a plug-in folder, then by entry point of other distributions."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from suite.case import Case
from suite.effect import Effect
from suite.estimator import Estimator
from suite.metric import Metric

# What each kind of plug-in is an instance (estimators and baselines: a subclass) of.
TYPES: dict[str, type] = {
    "estimators": Estimator, "baselines": Estimator, "cases": Case, "effects": Effect, "metrics": Metric
}  # fmt: skip
WORDS = {Estimator: "an estimator", Case: "a case", Effect: "an effect", Metric: "a metric"}
KINDS = ("estimators", "baselines", "cases", "effects", "metrics")
# Metrics are of the benchmark alone, so their folder is there.
FOLDERS = {"metrics": "suite.benchmark.measures"}


@dataclass(frozen=True)
class Found:
    """The plug-ins of one kind by name, with where each came from; and those that could not be loaded, and why."""

    loaded: dict[str, Any] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    origins: dict[str, str] = field(default_factory=dict)


@cache
def find(kind: str) -> Found:
    """All plug-ins of a kind: "estimators" and "baselines" (instances), "cases", "effects", "metrics".

    The package's own come first, so that no other distribution can take a name from them.
    """
    own = _own(kind)
    found = Found(dict(own.loaded), dict(own.failed), dict(own.origins))
    # Estimators and baselines are judged side by side under their names.
    rival = {"estimators": lambda: _own("baselines"), "baselines": lambda: find("estimators")}.get(kind)
    if rival is not None:
        found.origins.update(rival().origins)
    for point in sorted(entry_points(group=f"unmodelled.{kind}"), key=lambda point: point.name):
        source = f" of {point.dist.name}" if point.dist is not None else ""
        take(found, kind, f"{point.value} (entry point {point.name}{source})", point.load)
    return found


@cache
def _own(kind: str) -> Found:
    """The plug-ins in the package's folder of a kind."""
    found = Found()
    if kind == "baselines":
        found.origins.update(_own("estimators").origins)
    folder = FOLDERS.get(kind, kind)
    package = importlib.import_module(folder)
    for file in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
        # What several plug-ins share has a name with _ and is none itself.
        if not file.startswith("_"):
            take(found, kind, f"{folder}.{file}", partial(importlib.import_module, f"{folder}.{file}"))
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


def take(found: Found, kind: str, label: str, load: Callable[[], Any]) -> None:
    """Add the plug-ins that `load` gives (a module or a plug-in), or the reason why there are none, under the label.

    A `kind` that is none of KINDS takes plug-ins of every kind.
    """
    wanted = (TYPES[kind],) if kind in TYPES else tuple(WORDS)
    try:
        thing = load()
        items = list({id(item): item for item in _items(thing)}.values())
        fitting = [item for item in items if isinstance(item, wanted)]
        if not fitting:
            raise TypeError(_says_nothing(thing, items, wanted))
        named = [(_name(item), item) for item in fitting]
    except (Exception, SystemExit) as error:  # a plug-in may fail in any way; the others must still run
        found.failed[label] = f"{type(error).__name__}: {error}"
        return
    refused = []
    for name, item in named:
        if found.loaded.get(name) is item:
            continue
        if name in found.origins:
            refused.append(f"the name {name!r} is already taken, by {found.origins[name]}; rename one")
        else:
            found.loaded[name], found.origins[name] = item, label
    if refused:
        found.failed[label] = "; ".join(refused)


def kind_of(item: Any) -> str:
    """The kind of a plug-in; an estimator that is no baseline of the package is one of "estimators"."""
    return next(kind for kind, wanted in TYPES.items() if isinstance(item, wanted))


def _name(item: Any) -> str:
    """A plug-in's name or id."""
    key = "id" if isinstance(item, Effect) else "name"
    name = getattr(item, key, None)
    if not isinstance(name, str) or not name or len(name.split()) != 1:
        what = f"the name {name!r}" if name is not None else "no name"
        raise TypeError(f'{_called(item)} has {what}; write {key} = "my-plug-in", without blanks')
    return name


def _called(item: Any) -> str:
    return type(item).__name__ if isinstance(item, Estimator) else WORDS[type(item)]


def _says_nothing(thing: Any, items: Sequence[Any], wanted: tuple[type, ...]) -> str:
    """Why there is no plug-in of the wanted types."""
    what = " or ".join(WORDS[one] for one in wanted)
    if items:
        kind = kind_of(items[0])
        return f"it holds {WORDS[TYPES[kind]]} where {what} belongs; move it to the folder or entry points of {kind}"
    values = vars(thing).values() if isinstance(thing, ModuleType) else [thing]
    for value in values:
        if inspect.isclass(value) and issubclass(value, Estimator) and value is not Estimator:
            lacking = ", ".join(sorted(getattr(value, "__abstractmethods__", ()))) or "nothing"
            return f"the class {value.__name__} lacks {lacking}; write it"
    return f"it holds no plug-in; expected {what}"


def _items(thing: Any) -> Iterator[Any]:
    """The plug-ins in a module, or the one that an entry point names."""
    for value in vars(thing).values() if isinstance(thing, ModuleType) else [thing]:
        if isinstance(value, (Case, Effect, Metric)) or (isinstance(value, Estimator) and value is thing):
            yield value
        elif inspect.isclass(value) and issubclass(value, Estimator) and not inspect.isabstract(value):
            # A class that a module imports from another is that one's plug-in.
            imported = isinstance(thing, ModuleType) and value.__module__ != thing.__name__
            if not imported:
                yield value()
