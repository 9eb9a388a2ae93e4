"""Which tests can notice a mistake: those that run the line, the quick ones first."""

from __future__ import annotations

import ast
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from coverage import CoverageData
from mutants import Mutant

# Tests of a browser, of documents and of kills cost much and say little of a line.
NOT_ASKED = ("test_page", "test_docs", "test_faults")
SECONDS = 240.0  # of tests that are run against one mistake


class Choice:
    """Reads the tests by line of a coverage file, and their seconds of a junit report."""

    def __init__(self, coverage: Path, durations: Path, root: Path) -> None:
        self.root, self.data = root, CoverageData(str(coverage))
        self.data.read()
        # A file was measured under several names where tests made copies of the project.
        self.files: dict[str, list[str]] = {}
        for name in self.data.measured_files():
            self.files.setdefault(_inside(name), []).append(name)
        self.callers: dict[str, set[str]] = {}
        self.seconds = {
            f"{case.get('file')}::{case.get('name')}": float(case.get("time", 0.0))
            for case in ElementTree.parse(durations).iter("testcase")
            if case.find("skipped") is None
        }

    def of(self, mutant: Mutant) -> list[str]:
        """The tests that run the mutant's line; of compiled code, which is not traced, those that run what calls it.
        Beside them those that read its file, which have the name of it in theirs.
        """
        found = self._contexts(mutant.path, {mutant.line})
        if not found and mutant.path.startswith("suite/kernels/"):
            found = self._callers(mutant.path)
        if not found:
            found = self._contexts(mutant.path, None)
        found = found | {test for test in self.seconds if test.endswith(f"[{mutant.path}]")}
        chosen, spent = [], 0.0
        for test in sorted(found, key=lambda test: (self.seconds[test], test)):
            spent += self.seconds[test]
            if spent > SECONDS and chosen:
                break
            chosen.append(test)
        return chosen

    def _contexts(self, path: str, lines: set[int] | None) -> set[str]:
        tests = set[str]()
        for name in self.files.get(path, ()):
            by_line = self.data.contexts_by_lineno(name)
            asked = by_line if lines is None else lines & set(by_line)
            tests |= {context.partition("|")[0] for line in asked for context in by_line[line]}
        return {test for test in tests if test in self.seconds and not any(name in test for name in NOT_ASKED)}

    def _callers(self, path: str) -> set[str]:
        """Tests of the lines that name what a kernel file makes, through other kernels."""
        if path in self.callers:
            return self.callers[path]
        module, found = path.removesuffix(".py").replace("/", "."), set[str]()
        for other in sorted(self.root.glob("*/**/*.py")):
            inside = other.relative_to(self.root).as_posix()
            if inside.startswith(("tests/", "bench/")) or not (lines := _uses(other, module)):
                continue
            found |= self._contexts(inside, lines)
            if inside.startswith("suite/kernels/"):
                found |= self._callers(inside)
        self.callers[path] = found
        return found


def _inside(name: str) -> str:
    """A measured file by its place in the project, whether it ran from a checkout or as an installed wheel."""
    parts = Path(name).parts
    for top in ("suite", "estimators", "baselines", "cases", "effects"):
        if top in parts:
            return Path(*parts[len(parts) - 1 - parts[::-1].index(top) :]).as_posix()
    return name


def _uses(path: Path, module: str) -> set[int]:
    """The lines in functions of a file that use a name from a module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == module
        for alias in node.names
    }
    return {node.lineno for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in names}
