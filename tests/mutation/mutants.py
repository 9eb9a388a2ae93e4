"""Which mistakes there are to make, and a sample of them."""

from __future__ import annotations

import ast
import hashlib
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.work_item import MutationSpec

Span = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class Mutant:
    """The `occurrence`th place of a file where an operator can act; line and column are where it does."""

    room: str
    path: str
    line: int
    column: int
    operator: str
    occurrence: int
    code: str  # a hash of the file: another file, another mistake

    @property
    def key(self) -> str:
        return f"{self.path}:{self.line}:{self.column} {self.operator} {self.occurrence} {self.code}"

    def spec(self, root: Path) -> MutationSpec:
        here = (self.line, self.column)
        return MutationSpec(root / self.path, self.operator, self.occurrence, here, (self.line, self.column + 1))


def drawn(root: Path, room: str, count: int, seed: int) -> list[Mutant]:
    """Places drawn at random among those of a room, and of each one of the mistakes that can be made there.

    A place with ten possible mistakes counts once: else most of the sample would be binary operators.
    """
    rng = random.Random(f"{seed} {room}")
    places: dict[tuple[str, int, int], list[Mutant]] = {}
    for path in sorted((root / room).glob("*.py")):
        for mutant in _mutants(root, room, path):
            places.setdefault((mutant.path, mutant.line, mutant.column), []).append(mutant)
    return [rng.choice(places[place]) for place in rng.sample(sorted(places), min(count, len(places)))]


def _mutants(root: Path, room: str, path: Path) -> Iterator[Mutant]:
    source = path.read_text(encoding="utf-8")
    code = hashlib.sha256(source.encode()).hexdigest()[:8]
    idle = _idle(ast.parse(source))
    tree = get_ast_from_path(path)
    for name in sorted(cosmic_ray.plugins.operator_names()):
        operator = cosmic_ray.plugins.get_operator(name)
        if operator.arguments() or name == "core/NoOp":
            continue
        places = (start for node in ast_nodes(tree) for start, _ in operator().mutation_positions(node))
        for occurrence, (line, column) in enumerate(places):
            if not any(first <= (line, column) < last for first, last in idle):
                yield Mutant(room, path.relative_to(root).as_posix(), line, column, name, occurrence, code)


def _idle(tree: ast.Module) -> list[Span]:
    """Where a change changes nothing: annotations, which are not evaluated."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation is not None:
            found.append(_span(node.annotation))
        elif isinstance(node, ast.FunctionDef) and node.returns is not None:
            found.append(_span(node.returns))
    return found


def _span(node: ast.expr) -> Span:
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    return (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)
