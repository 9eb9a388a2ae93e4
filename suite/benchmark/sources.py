"""The sources that a plug-in is made of: its module and, by their import statements, the modules it builds on."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterator
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path

# The package's folders that plug-ins build on; what they take from elsewhere is pinned by the versions in the row.
OURS = ("suite", "estimators", "baselines")
# What runs, judges and shows plug-ins is no part of them.
ABOVE = ("suite.benchmark", "suite.report", "suite.discovery")


def closure(name: str) -> list[tuple[str, str]]:
    """The modules, by name with their text, that a module is made of: itself, and all that it or these import of OURS
    (not ABOVE) or of its own package.
    """
    own = name.split(".")[0]
    todo, found = [name], dict[str, str]()
    while todo:
        module = todo.pop()
        if module not in found:
            found[module] = text(module)
            todo += [other for other in imported(module) if _counts(other, own)]
    return sorted(found.items())


@cache
def text(name: str) -> str:
    """A module's code without comments, docstrings and layout, which change no number; empty where it has no source."""
    tree = _tree(name)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(
            node
        ):
            node.body = node.body[1:]
    return ast.unparse(tree)


@cache
def imported(name: str) -> tuple[str, ...]:
    """The modules that a module's import statements name, wherever in it they stand."""
    spec = _spec(name)
    package = (name if spec.submodule_search_locations else name.rpartition(".")[0]) if spec else ""
    return tuple(dict.fromkeys(module for node in ast.walk(_tree(name)) for module in _named(node, package)))


def _named(node: ast.AST, package: str) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        origin = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
        yield origin
        # What is imported from a package may be a module of it.
        yield from (f"{origin}.{alias.name}" for alias in node.names)


def _counts(name: str, own: str) -> bool:
    inside = name.split(".")[0] in {*OURS, own}
    return inside and not any(f"{name}.".startswith(f"{part}.") for part in ABOVE) and _spec(name) is not None


def _tree(name: str) -> ast.Module:
    spec = _spec(name)
    file = Path(spec.origin) if spec is not None and spec.origin else None
    return ast.parse(file.read_bytes() if file is not None and file.suffix == ".py" else b"")


@cache
def _spec(name: str) -> ModuleSpec | None:
    """Where a module is, or None where the name is none of a module: a class, a number."""
    try:
        return importlib.util.find_spec(name)
    except (ImportError, AttributeError, ValueError):
        return None
