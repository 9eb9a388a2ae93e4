"""The house is in order: files are short, public names are documented, what is handed on cannot be changed, and imports
run one way.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OURS = ("suite", "estimators", "baselines", "cases", "effects")
FILES = sorted(path for room in (*OURS, "tests", "bench", "docs") for path in (ROOT / room).rglob("*.py"))
CODE = [path for path in FILES if path.relative_to(ROOT).parts[0] in OURS]
LONGEST = 300
# A server's own state, which changes with every request.
CHANGING = {"Desk"}


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_a_file_is_short(path: Path) -> None:
    """At most 300 lines: one idea a file."""
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST


@pytest.mark.parametrize("path", CODE, ids=_name)
def test_public_names_are_documented_and_what_is_handed_on_is_frozen(path: Path) -> None:
    """Modules, classes, functions and methods without a leading underscore have a docstring; dataclasses are frozen."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    bare, loose = [] if ast.get_docstring(tree) or not tree.body else ["the module"], []
    for holder in (tree, *(node for node in tree.body if isinstance(node, ast.ClassDef))):
        for node in holder.body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                private = node.name.startswith("_") or getattr(holder, "name", "").startswith("_")
                overrides = isinstance(holder, ast.ClassDef) and not _first(holder, node.name)
                declared = ast.unparse(node.body[-1]) == "..."
                if not (private or overrides or declared or ast.get_docstring(node)):
                    bare.append(node.name)
            if isinstance(node, ast.ClassDef) and node.name not in CHANGING:
                loose += [node.name for mark in node.decorator_list if _loose(mark)]
    assert (bare, loose) == ([], [])


def _classes() -> dict[str, ast.ClassDef]:
    trees = (ast.parse(path.read_text(encoding="utf-8")) for path in CODE)
    return {node.name: node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)}


CLASSES = _classes()


def _first(holder: ast.ClassDef, name: str) -> bool:
    """Whether a method is the class's own idea: what a base class has documented needs no words again."""
    for base in map(ast.unparse, holder.bases):
        above = CLASSES.get(base.partition("[")[0])
        if above is None:
            if base.partition("[")[0] not in ("Protocol", "NamedTuple"):
                return False
        elif any(getattr(node, "name", "") == name for node in above.body) or not _first(above, name):
            return False
    return True


def _loose(mark: ast.expr) -> bool:
    """Whether a decorator makes a dataclass that can be changed."""
    called = mark.func if isinstance(mark, ast.Call) else mark
    if not (isinstance(called, ast.Name) and called.id == "dataclass"):
        return False
    given = {word.arg: ast.unparse(word.value) for word in mark.keywords} if isinstance(mark, ast.Call) else {}
    return given.get("frozen") != "True"


@pytest.mark.parametrize(
    ("room", "never"),
    [
        ("suite/kernels", ("suite.discovery", "suite.benchmark", "suite.report", "suite.web", "suite.fleet")),
        ("suite/discovery", ("suite.benchmark", "suite.report", "suite.web", "suite.fleet", "suite.verbs")),
        ("suite/benchmark", ("suite.report", "suite.web")),
        ("suite/report", ("suite.web",)),
        ("suite", ("tests", "bench")),
    ],
)
def test_imports_run_one_way(room: str, never: tuple[str, ...]) -> None:
    """From the page down to the kernels: no room knows who uses it."""
    for path in (ROOT / room).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [name.name for name in node.names]
                up = [name for name in names if name.startswith(tuple(f"{top}." for top in never)) or name in never]
                assert not up, f"{_name(path)} imports {up}"
