"""Pages hold together: links lead somewhere, tables are those of the stored results, the site needs no network."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from suite import plugins
from suite.model_file import read_model

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WRITTEN = sorted(DOCS.glob("*.md")) if DOCS.is_dir() else []
LINK = re.compile(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"")
MADE = {"notebook.md"}  # from the notebook, when the site is built

pytestmark = pytest.mark.skipif(
    not DOCS.is_dir(), reason="the documentation is in a checkout, not beside an installed package"
)


def anchors(text: str) -> set[str]:
    """What the headings of a page are called in a link."""
    bare = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", bare, re.MULTILINE)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading.lower()).strip()) for heading in headings}


@pytest.mark.parametrize("page", [*WRITTEN, ROOT / "README.md"], ids=lambda path: path.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    """To a file that is there, and to a heading that it has."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in (first or second for first, second in LINK.findall(text)):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if target.name in MADE:
            continue
        assert target.exists(), f"{page.name}: {link}"
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{page.name}: {link}"


def pictures() -> Any:
    """docs/pictures.py as a module."""
    spec = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", ["gallery.md", "limits.md", "matrix.md"])
def test_tables_of_a_page_are_those_of_the_stored_results(page: str) -> None:
    """Mend by `python docs/pictures.py --tables`, and the pictures by `tox run -e pictures`."""
    made = pictures()
    text = (DOCS / page).read_text(encoding="utf-8")
    assert made.with_tables(text) == text


@pytest.mark.parametrize("name", ["whiffle-ball", "emps", "silverbox", "cooling-mug"])
def test_the_error_in_a_picture_is_the_stored_one(name: str) -> None:
    """The title of a case's picture has both errors of `bench measured`."""
    made = pictures()
    rows = made.gallery.stored(made.MEASURED)
    part = made.CASES[name]
    row = next(row for row in rows if (row["case"], row["part"]) == (name, part))
    drawn = (DOCS / "pictures" / f"{name}.svg").read_text(encoding="utf-8")
    title = re.search(r"<title>(.*?)</title>", drawn)
    assert title is not None
    assert f"from {row['before']:.3g} to {row['after']:.3g}" in title[1]


def test_pictures_are_small_and_all_of_them_are_shown() -> None:
    """Each below 150 kB and in a page."""
    text = "".join(path.read_text(encoding="utf-8") for path in [*WRITTEN, ROOT / "README.md"])
    for path in (DOCS / "pictures").glob("*.svg"):
        assert path.stat().st_size < 150_000, path.name
        assert f"pictures/{path.name}" in text, path.name


class _Loaded(HTMLParser):
    """The addresses that a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag in ("script", "img", "iframe", "source"):
            self.found.append(given.get("src") or "")
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preconnect", "preload"):
            self.found.append(given.get("href") or "")


@pytest.mark.skipif(importlib.util.find_spec("mkdocs") is None, reason="mkdocs is in `tox run -e docs`")
def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    """Formulas are MathML, and scripts, styles and pictures lie beside the pages."""
    for name in ("docs", "results"):
        shutil.copytree(ROOT / name, tmp_path / name)
    for name in ("mkdocs.yml", "suite"):
        (tmp_path / name).symlink_to(ROOT / name)
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", tmp_path / "mkdocs.yml", "-d", tmp_path / "site"],
        cwd=tmp_path, capture_output=True, text=True, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    built = list((tmp_path / "site").glob("*.html"))
    assert len(built) > len(WRITTEN)
    for path in built:
        page = _Loaded()
        page.feed(path.read_text(encoding="utf-8"))
        assert not [address for address in page.found if address.startswith(("http:", "https:", "//"))], path.name
    text = (tmp_path / "site" / "mathematics.html").read_text(encoding="utf-8")
    assert text.count("<math") > 40
    assert "arithmatex" not in text


@pytest.mark.parametrize("page", ["own-data.md", "write-a-model.md"])
def test_the_python_of_a_page_runs(page: str) -> None:
    """Its blocks, one after another, as they stand."""
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    exec(compile("\n".join(blocks), page, "exec"), {})


def test_the_model_of_the_page_is_the_same_in_both_languages(tmp_path: Path) -> None:
    """The file and the Python below it say the same, but for the name of the source."""
    text = (DOCS / "write-a-model.md").read_text(encoding="utf-8")
    file, code = (re.search(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("toml", "python"))
    assert file is not None
    assert code is not None
    (tmp_path / "plant.toml").write_text(file[1], encoding="utf-8")
    built: dict[str, object] = {}
    exec(compile(code[1], "write-a-model.md", "exec"), built)
    assert read_model(tmp_path / "plant.toml") == built["model"]


def test_the_pages_count_the_effects_right() -> None:
    """Where a page says how many effects the library holds."""
    pages = [DOCS / "idea.md", DOCS / "tutorial.md"]
    said = re.findall(r"\b(\d+) effects\b", "".join(path.read_text(encoding="utf-8") for path in pages))
    assert len(said) == 2
    assert {int(count) for count in said} == {len(plugins.effects())}
