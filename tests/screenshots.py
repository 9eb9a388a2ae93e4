"""The pictures of the page in docs/pictures, made again in a real browser: `tox -e page-pictures`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
PLAN = """cases = ["paper-cubic", "pendulum-dry-friction"]
estimators = ["generalized-ie", "conventional-ie", "sra", "ekf", "ekf-disturbance", "ukf", "random-walk-smoother"]
variants = ["default"]
noises = [0.05]
seeds = 3
limit = 60
"""


def shot(page: Page, name: str) -> None:
    """One picture, with the pointer where it shows nothing."""
    page.mouse.move(2, 2)
    file = PICTURES / f"page-{name}.png"
    page.screenshot(path=file)
    # A third of the size; the farthest colour is 11 of 255 off. Other ways to choose the palette turn red into orange.
    with Image.open(file) as picture:
        small = picture.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    small.save(file, optimize=True)
    print(f"{file}: {file.stat().st_size // 1024} kB")


def analysed(page: Page) -> None:
    """Analyse, and wait until its candidates are drawn."""
    page.get_by_role("button", name="Analyse").click()
    page.locator(".verdict").wait_for()
    page.locator("#analyse").wait_for()


def tour(page: Page, url: str) -> None:
    """The cooling mug from the empty page to the error at the noise, then the benchmark."""
    page.goto(url)
    page.locator("#examples:not([disabled])").wait_for()
    shot(page, "start")
    page.get_by_role("button", name="Try the cooling mug").click()
    page.locator("#panel-steps .main-svg").first.wait_for()
    analysed(page)
    shot(page, "mug")
    best = page.locator(".candidate").first
    best.get_by_role("button", name="Preview").click()
    page.locator("#fit", has_text="→").wait_for()
    shot(page, "preview")
    best.get_by_role("button", name="Add").click()
    page.locator("#cancel").wait_for()
    page.locator("#analyse").wait_for()
    page.get_by_role("tab", name="History").click()
    shot(page, "added")
    page.get_by_role("button", name="Other examples").click()
    page.get_by_role("menuitem", name="paper").first.click()
    page.locator("#sources", has_text="paper").wait_for()
    analysed(page)
    page.set_viewport_size({"width": 400, "height": 820})
    shot(page, "narrow")
    page.set_viewport_size({"width": 1400, "height": 820})
    page.get_by_role("button", name="Benchmark").click()
    page.get_by_role("columnheader", name="state error").get_by_role("button").click()
    page.locator(".matrix .open").first.click()
    page.locator(".cell .main-svg").first.wait_for()
    shot(page, "benchmark")


def main() -> None:
    """Start a server with a small store, and take the pictures."""
    folder = Path("out") / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    PICTURES.mkdir(parents=True, exist_ok=True)
    (folder / "plan.toml").write_text(PLAN, encoding="utf-8")
    store = str(folder / "results.sqlite")
    command = [sys.executable, "-m", "suite"]
    subprocess.run([*command, "bench", "run", "--plan", str(folder / "plan.toml"), "--store", store], check=True)
    serve = [*command, "serve", "--no-browser", "--port", "0", "--store", store]
    with subprocess.Popen(serve, stdout=subprocess.PIPE, text=True) as server, sync_playwright() as player:
        assert server.stdout is not None
        url = server.stdout.readline().strip()
        flags = ["--no-sandbox"] if os.geteuid() == 0 else []
        browser = player.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1400, "height": 820}, reduced_motion="reduce")
        page.set_default_timeout(240_000)
        try:
            tour(page, url)
        finally:
            browser.close()
            server.terminate()


if __name__ == "__main__":
    main()
