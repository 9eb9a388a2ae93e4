"""Formulas of a page as MathML, which browsers draw by themselves: no script, no fonts, no network."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content: str, /, **_: Any) -> str:
    """Replace what `pymdownx.arithmatex` has marked."""

    def drawn(found: re.Match[str]) -> str:
        display = "block" if found[1] == "div" else "inline"
        text: str = convert(html.unescape(found[2]).strip(), display=display)
        return f'<div class="formula">{text}</div>' if display == "block" else text

    return FORMULA.sub(drawn, content)
