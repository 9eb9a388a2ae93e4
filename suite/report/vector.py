"""Figures as SVG: accessible, the same bytes each time, small, and without reference to anything outside."""

from __future__ import annotations

import html
import io
import re
import threading
import warnings
from collections import Counter
from collections.abc import Mapping
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.text import Text

# Fonts and hashes of ids come from matplotlib's global settings, so one figure is written at a time.
_WRITING = threading.Lock()
STYLE = r'style="([^"]*)"'
OFTEN = 4  # times that a style stands in a page from which it gets a name
LONG = 60  # letters of a path from which it is worth its steps
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


def share(drawn: Mapping[str, str]) -> tuple[dict[str, str], str]:
    """Figures of one page, and one hidden SVG element with the letters and styles that they have in common."""
    letters: dict[str, str] = {}
    shared = {}

    def short(letter: str) -> str:
        # Thousands of them stand in a page of many figures.
        return "l-" + letter.replace("DejaVuSans", "").strip("-").lower()

    for name, text in drawn.items():

        def collect(match: re.Match[str]) -> str:
            letters[match[1]] = f'<path id="{short(match[1])}"{match[2]}/>'
            return ""

        kept = re.sub(rf'<path id="{name}-(DejaVu[\w-]*)"([^>]*)/>', collect, text)
        kept = re.sub(rf'href="#{name}-(DejaVu[\w-]*)"', lambda found: f'href="#{short(found[1])}"', kept)
        shared[name] = kept.replace("<defs></defs>", "")
    counts = Counter(style for text in shared.values() for style in re.findall(STYLE, text))
    classes = {style: f"s{at}" for at, (style, count) in enumerate(counts.most_common()) if count >= OFTEN}
    for name, text in shared.items():
        shared[name] = re.sub(
            STYLE, lambda found: f'class="{classes[found[1]]}"' if found[1] in classes else found[0], text
        )
    rules = "".join(f".{label}{{{style}}}" for style, label in classes.items())
    hidden = 'width="0" height="0" style="position:absolute" aria-hidden="true"'
    return shared, f"<svg {hidden}><style>{rules}</style><defs>{''.join(letters.values())}</defs></svg>"


def _escaped(text: str) -> str:
    # XML has no place for control characters, escaped or not.
    return html.escape("".join(letter if letter.isprintable() else "?" for letter in text))


def _small(body: str, name: str) -> str:
    """The body without metadata, comments, ids that nothing refers to and styles that are there twice, numbers to a
    hundredth of a point, curves to a tenth.
    """
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", body, flags=re.DOTALL)
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', body))
    body = re.sub(r' id="([^"]*)"', lambda found: f' id="{name}-{found[1]}"' if found[1] in used else "", body)
    body = body.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    # What a marker's own path says, its copies need not say again.
    own = dict(re.findall(r'<path id="([^"]+)"[^>]* style="([^"]*)"', body))
    body = re.sub(r'(<use xlink:href="#([^"]+)"[^>]*) style="([^"]*)"', lambda use: _copy(use, own), body)
    body = body.replace("<use xlink:href=", "<use href=")
    body = re.sub(r'\bd="([^"]*)"', lambda path: f'd="{_path(path[1])}"', body)
    body = re.sub(r'\b[xy]="[^"]*"|translate\([^)]*\)', lambda place: _rounded(place[0]), body)
    body = re.sub(r'transform="translate\(([^ )]+) 0\)"/>', r'x="\1"/>', body)
    return _ungrouped(re.sub(r">\s+<", "><", body).strip())


def _ungrouped(body: str) -> str:
    """The body without groups that say nothing."""
    out: list[str] = []
    said: list[bool] = []
    for part in re.split(r"(</?g\b[^>]*>)", body):
        if part.startswith("<g") and not part.endswith("/>"):
            said.append(part != "<g>")
            out.append(part if said[-1] else "")
        elif part == "</g>":
            out.append(part if said.pop() else "")
        else:
            out.append(part)
    return "".join(out)


def _rounded(numbers: str) -> str:
    return re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), numbers)


def _copy(use: re.Match[str], own: Mapping[str, str]) -> str:
    said = {part.strip() for part in own.get(use[2], "").split(";")}
    rest = "; ".join(part.strip() for part in use[3].split(";") if part.strip() not in said)
    return f'{use[1]} style="{rest}"' if rest else use[1]


def _path(path: str) -> str:
    """A path to a hundredth of a point, the tiny strokes that stand for points as 'h.01', long curves in steps."""
    short = re.sub(r"\s*([MLQCz])\s*", r"\1", _rounded(path)).strip()
    short = re.sub(r"M(\S+) ([^\sML]+)L(\S+) \2(?=M|$)", _stroke, short)
    return short if len(short) < LONG or re.search("[QCh]", short) else _in_steps(short)


def _in_steps(path: str) -> str:
    """A path of straight lines as the steps from point to point, each point to a tenth of a point."""
    out: list[str] = []
    x = y = 0
    said = ""
    for command, text in re.findall(r"([MLz])([^MLz]*)", path):
        if command == "z":
            out.append("z")
            said = "z"
            continue
        places = [round(10.0 * float(number)) for number in text.split()]
        dx, dy = places[0] - x, places[1] - y
        x, y = places
        if command == "M":
            out.append(f"M{_tenths(x)} {_tenths(y)}")
        elif dx or dy:
            # A command that follows itself need not be said.
            first = "l" if said != "L" else "" if dx < 0 else " "
            out.append(f"{first}{_tenths(dx)}{'' if dy < 0 else ' '}{_tenths(dy)}")
        else:
            continue
        said = command
    return "".join(out)


def _tenths(value: int) -> str:
    whole, part = divmod(abs(value), 10)
    text = f"{whole or ''}.{part}" if part else str(whole)
    return f"-{text}" if value < 0 else text


def _stroke(match: re.Match[str]) -> str:
    if abs(float(match[3]) - float(match[1])) > 0.2:
        return match[0]
    return f"M{match[1]} {match[2]}h.01"
