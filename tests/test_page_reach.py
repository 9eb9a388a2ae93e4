"""The page works by keys alone, on a narrow screen, in two tabs and without its server; nobody else gets in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra web is not installed")
api = pytest.importorskip("playwright.sync_api", reason="the browser tests need playwright")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium (Debian: apt-get install chromium)")

LONG = 180_000  # ms
PLAN = """cases = ["paper-cubic"]
estimators = ["ekf", "random-walk-smoother"]
variants = ["default"]
noises = [0.05]
seeds = 1
limit = 60
"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    flags = ["--host-resolver-rules=MAP elsewhere.example 127.0.0.1"]
    with api.sync_playwright() as player:
        browser = player.chromium.launch(
            executable_path=CHROMIUM, args=[*flags, "--no-sandbox"] if os.geteuid() == 0 else flags
        )
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served(serve: Callable[..., Any]) -> Any:
    return serve()


@pytest.fixture
def context(browser: Any) -> Iterator[Any]:
    context = browser.new_context(viewport={"width": 1400, "height": 820})
    context.set_default_timeout(LONG)
    yield context
    context.close()


def ready(context: Any, served: Any) -> Any:
    page = context.new_page()
    page.goto(served.url)
    page.locator("#examples:not([disabled])").wait_for()
    return page


def example(page: Any, name: str = "paper") -> None:
    page.get_by_role("button", name="Other examples").click()
    page.get_by_role("menuitem", name=name).first.click()
    page.locator("#panel-steps .main-svg").first.wait_for()


def test_every_control_is_reached_by_the_tab_key_and_enter_works(context: Any, served: Any) -> None:
    page = ready(context, served)
    example(page)
    page.locator(".skip").focus()
    seen: set[str] = set()
    for _ in range(80):
        # What has the focus, by id; a control without one by its name.
        focused = page.locator(":focus")
        if focused.count() == 0:
            break
        seen.add(focused.get_attribute("id") or focused.get_attribute("aria-label") or focused.inner_text())
        page.keyboard.press("Tab")
    wanted = {"example", "examples", "open-model", "open-data", "analyse", "undo", "save-model", "benchmark", "output"}
    wanted |= {"drag-mark", "drag-zoom", "show-all", "tab-text", "model-text"}
    # What can do nothing yet takes no focus.
    assert wanted - {"undo"} <= seen
    assert len([name for name in seen if name.startswith("Numbers of the plot")]) >= 3

    page.locator("#tab-text").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#pane-parameters").is_visible()
    page.locator("#analyse").focus()
    page.keyboard.press("Enter")
    page.locator("#cancel").wait_for()
    api.expect(page.locator("#cancel")).to_be_focused()
    page.keyboard.press("Enter")
    page.locator("#analyse").wait_for()
    api.expect(page.locator("#analyse")).to_be_focused()


def test_ears_find_landmarks_headings_and_a_sentence_for_every_plot(context: Any, served: Any) -> None:
    page = ready(context, served)
    example(page)
    assert page.get_by_role("banner").count() == 1
    assert page.get_by_role("main").count() == 1
    assert page.get_by_role("heading", level=1).inner_text() == "unmodelled"
    plot = page.get_by_role("img", name="Measured and model")
    assert "fit" in (plot.get_attribute("aria-label") or "")
    assert page.get_by_role("tab", selected=True).count() == 1
    nameless = [
        button.evaluate("e => e.outerHTML")
        for button in page.get_by_role("button").all()
        if not (button.get_attribute("aria-label") or button.inner_text().strip())
    ]
    assert nameless == []


def test_a_narrow_screen_shows_all_in_one_column_and_a_wide_one_all_without_scrolling(
    context: Any, served: Any
) -> None:
    page = ready(context, served)
    example(page)
    root = page.locator("html")
    assert root.evaluate("e => e.scrollHeight <= e.clientHeight && e.scrollWidth <= e.clientWidth")
    page.set_viewport_size({"width": 400, "height": 800})
    assert root.evaluate("e => e.scrollWidth <= e.clientWidth")
    left = {round(page.locator(f"#panel-{name}").bounding_box()["x"]) for name in ("fit", "residual", "error", "steps")}
    assert len(left) == 1


def test_two_tabs_keep_histories_of_their_own(context: Any, served: Any) -> None:
    one, other = ready(context, served), ready(context, served)
    example(one, "paper")
    example(other, "null-oscillator")
    one.get_by_role("button", name="Analyse").click()
    other.get_by_role("button", name="Analyse").click()
    for page in (one, other):
        page.locator(".verdict").wait_for()
    assert "cubic stiffness" in one.locator("#headline").inner_text()
    assert "Nothing is missing" in other.locator(".verdict").inner_text()
    one.get_by_role("tab", name="History").click()
    assert one.locator(".step strong").all_inner_texts() == ["paper, as given", "refitted"]


def test_sliders_simulate_the_values_and_keep_them_in_the_text(context: Any, served: Any) -> None:
    page = ready(context, served)
    example(page)
    page.get_by_role("tab", name="Parameters").click()
    before = page.locator("#fit").inner_text()
    field = page.locator(".slider input[type=number]").first
    name = page.locator(".slider .name").first.inner_text()
    field.fill("0.9")
    page.locator("#fit", has_text="→").wait_for()
    page.get_by_role("button", name="Keep").click()
    page.locator("#sources", has_text=f"{name} = 0.9").wait_for()
    assert page.locator("#fit").inner_text() != before
    page.get_by_role("button", name="Undo").click()
    api.expect(page.locator("#fit")).to_have_text(before)


def test_a_lost_server_is_said_and_loses_nothing(context: Any, serve: Callable[..., Any]) -> None:
    served = serve()
    page = ready(context, served)
    example(page)
    served.end()
    page.get_by_role("button", name="Analyse").click()
    page.locator("#problem", has_text="does not answer").wait_for()
    assert page.locator("#panel-fit .main-svg").first.is_visible()
    assert "[states]" in page.get_by_label("Model text (TOML)").input_value()


def test_other_names_and_other_pages_are_refused(context: Any, served: Any, tmp_path: Path) -> None:
    inside = ready(context, served)
    assert inside.title() == "unmodelled"
    stranger = context.new_page()
    answer = stranger.goto(served.url.replace("127.0.0.1", "elsewhere.example"))
    assert answer is not None
    assert answer.status in (400, 403, 421)

    # A page of another origin in the same browser, which holds the cookie, may post nothing and read nothing.
    target = f"{served.origin}/api/example"
    script = f"""fetch({target!r}, {{method: "POST", credentials: "include", mode: "no-cors", body: '{{}}'}})
        .then(() => document.body.append("sent"), () => document.body.append("failed"));"""
    (tmp_path / "index.html").write_text(f"<body><script>{script}</script>", encoding="utf-8")
    foreign = ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=str(tmp_path)))
    threading.Thread(target=foreign.serve_forever, daemon=True).start()
    statuses: list[int] = []
    stranger.on("response", lambda response: statuses.append(response.status) if response.url == target else None)
    stranger.goto(f"http://127.0.0.1:{foreign.server_port}/")
    stranger.get_by_text("sent").or_(stranger.get_by_text("failed")).wait_for()
    foreign.shutdown()
    foreign.server_close()
    assert all(status in (400, 403) for status in statuses)


def test_the_benchmark_sorts_filters_and_opens_the_trajectories_of_a_row(
    context: Any, serve: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    store = tmp_path / "results.sqlite"
    command = [
        sys.executable,
        "-m",
        "suite",
        "bench",
        "run",
        "--plan",
        str(tmp_path / "plan.toml"),
        "--store",
        str(store),
    ]
    subprocess.run(command, check=True, capture_output=True)
    page = ready(context, serve("--store", str(store)))
    page.get_by_role("button", name="Benchmark").click()
    head = page.get_by_role("columnheader", name="estimator")
    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "ascending"
    rows = page.locator(".matrix tbody tr")
    assert [row.locator("td").nth(1).inner_text() for row in rows.all()] == ["ekf", "random-walk-smoother"]
    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "descending"
    page.get_by_label("Filter by text").fill("smoother")
    api.expect(rows).to_have_count(1)
    rows.first.get_by_role("button").click()
    page.locator(".cell .main-svg").first.wait_for()
    assert "root mean square" in (page.locator(".cell .plot").first.get_attribute("aria-label") or "")
