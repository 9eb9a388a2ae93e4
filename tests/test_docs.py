"""What the documentation says of a number is what the code has."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path

import pytest

import suite.discovery

DOCS = Path(__file__).parents[1] / "docs"
STATED = re.compile(r"\b([A-Z]{3,})\s=\s([0-9.e-]*[0-9])(\s%)?")
BESIDE = re.compile(r"([0-9.]*[0-9])\s\(([A-Z]{3,})\)")


def constants() -> dict[str, set[float]]:
    """Every number, or tuple of numbers, that a module of discovery names in capitals."""
    found: dict[str, set[float]] = {}
    for info in pkgutil.iter_modules(suite.discovery.__path__):
        module = importlib.import_module(f"suite.discovery.{info.name}")
        for name, value in vars(module).items():
            values = value if isinstance(value, tuple) else (value,)
            if name.isupper() and all(isinstance(v, (int, float)) for v in values):
                found.setdefault(name, set()).update(map(float, values))
    return found


@pytest.mark.parametrize("page", ["method.md", "verdict.md"])
def test_a_stated_constant_is_the_codes(page: str) -> None:
    """NAME = value, or value (NAME), in a page is a constant of that name and value."""
    if not DOCS.is_dir():
        pytest.skip("the documentation is in a checkout, not beside an installed package")
    known = constants()
    text = (DOCS / page).read_text(encoding="utf-8")
    stated = [*STATED.findall(text), *((name, number, "") for number, name in BESIDE.findall(text))]
    for name, number, percent in stated:
        value = float(number) / (100.0 if percent else 1.0)
        assert any(abs(value - own) < 1e-12 for own in known.get(name, ())), f"{name} = {number}{percent}"
    assert len(stated) > (20 if page == "method.md" else 2)
