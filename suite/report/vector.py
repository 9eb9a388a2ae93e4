"""Figures as SVG: accessible, the same bytes each time, small, and without reference to anything outside."""

from __future__ import annotations

import html
import io
import re
import threading
import warnings
from collections.abc import Mapping
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.text import Text

# Fonts and hashes of ids come from matplotlib's global settings, so one figure is written at a time.
_WRITING = threading.Lock()
_SETTINGS: Any = {"svg.fonttype": "path", "svg.hashsalt": "unmodelled", "path.simplify": False}


def svg(fig: Figure, name: str = "figure") -> str:
    """The figure as an SVG element with a role, a title (the figure's) and a description (the figure's label).

    `name` goes in front of every id, so that several can stand in one page.
    """
    title, description = " ".join(fig.get_suptitle().split()), " ".join(str(fig.get_label()).split())
    for text in fig.findobj(Text):
        # A name such as a$b is text, not a formula.
        if isinstance(text, Text):
            text.set_parse_math(False)
    buffer = io.StringIO()
    with _WRITING, matplotlib.rc_context(_SETTINGS), warnings.catch_warnings():
        # A letter that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        fig.savefig(buffer, format="svg", metadata={"Date": None})
    drawn = buffer.getvalue()
    opening, body = drawn[drawn.index("<svg ") + len("<svg ") :].split(">", 1)
    # The page sets the size; width and height in points would not shrink on a telephone.
    opening = re.sub(r'\s(width|height)="[^"]*pt"', "", " " + opening).strip()
    words = f"<title>{_escaped(title)}</title><desc>{_escaped(description)}</desc>"
    return f'<svg role="img" aria-label="{_escaped(title)}" {opening}>{words}{_small(body, name)}'


def share_letters(drawn: Mapping[str, str]) -> tuple[dict[str, str], str]:
    """Figures of one page, and the letters that they draw as one hidden SVG element for all of them."""
    letters: dict[str, str] = {}
    shared = {}
    for name, text in drawn.items():

        def collect(match: re.Match[str]) -> str:
            letters[match[1]] = f'<path id="letter-{match[1]}"{match[2]}/>'
            return ""

        kept = re.sub(rf'<path id="{name}-(DejaVu[\w-]*)"([^>]*)/>', collect, text)
        shared[name] = kept.replace(f'href="#{name}-DejaVu', 'href="#letter-DejaVu').replace("<defs></defs>", "")
    hidden = 'width="0" height="0" style="position:absolute" aria-hidden="true"'
    return shared, f"<svg {hidden}><defs>{''.join(letters.values())}</defs></svg>"


def _escaped(text: str) -> str:
    # XML has no place for control characters, escaped or not.
    return html.escape("".join(letter if letter.isprintable() else "?" for letter in text))


def _small(body: str, name: str) -> str:
    """The body without metadata, comments and ids that nothing refers to, numbers to a hundredth of a point."""
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", body, flags=re.DOTALL)
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', body))
    body = re.sub(r' id="([^"]*)"', lambda found: f' id="{name}-{found[1]}"' if found[1] in used else "", body)
    body = body.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    body = re.sub(r'\bd="([^"]*)"', lambda path: f'd="{_path(path[1])}"', body)
    body = re.sub(r'\b[xy]="[^"]*"|translate\([^)]*\)', lambda place: _rounded(place[0]), body)
    return re.sub(r">\s+<", "><", body).strip()


def _rounded(numbers: str) -> str:
    return re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), numbers)


def _path(path: str) -> str:
    """A path to a hundredth of a point, the tiny strokes that stand for points as 'h.01'."""
    short = re.sub(r"\s*([MLQCz])\s*", r"\1", _rounded(path)).strip()
    return re.sub(r"M(\S+) ([^\sML]+)L(\S+) \2(?=M|$)", _stroke, short)


def _stroke(match: re.Match[str]) -> str:
    if abs(float(match[3]) - float(match[1])) > 0.2:
        return match[0]
    return f"M{match[1]} {match[2]}h.01"
