"""The search from a folder: its worker shim comes from beside the pages instead of from a network."""

from __future__ import annotations

from typing import Any

ELSEWHERE = "https://unpkg.com/iframe-worker/shim"


def on_post_page(output: str, /, *, page: Any, **_: Any) -> str:
    """Point the script that the `offline` plugin adds at docs/iframe-worker.js."""
    up = "../" * page.url.count("/")
    return output.replace(ELSEWHERE, f"{up}iframe-worker.js")


def on_post_template(output: str, /, **_: Any) -> str:
    """The page for what is not found has the script too."""
    return output.replace(ELSEWHERE, "iframe-worker.js")
