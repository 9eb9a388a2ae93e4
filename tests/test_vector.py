"""Figures as SVG stay the same picture while they are made small."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from suite.report import vector

POINTS = st.lists(st.tuples(*[st.floats(-2000.0, 2000.0)] * 2), min_size=2, max_size=60)


def _places(path: str) -> list[tuple[float, float]]:
    """The points that a path of M, L, l and z goes through, z as the point where its part began."""
    found: list[tuple[float, float]] = []
    x = y = 0.0
    first = (0.0, 0.0)
    for command, text in re.findall(r"([MLlz])([^MLlz]*)", path):
        numbers = [float(number) for number in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", text)]
        for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
            x, y = (x + dx, y + dy) if command == "l" else (dx, dy)
            found.append((x, y))
            first = (x, y) if command == "M" else first
        if command == "z":
            found.append(first)
            x, y = first
    return found


@given(st.lists(st.tuples(POINTS, st.booleans()), min_size=1, max_size=4))
def test_steps_lead_through_the_same_points(parts: list[tuple[list[tuple[float, float]], bool]]) -> None:
    """To a tenth of a point and without drift, however many there are; a point on the spot of the last may go."""
    path = "".join(
        "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in points) + ("z" if closed else "") for points, closed in parts
    )
    short = vector._in_steps(path)  # pyright: ignore[reportPrivateUsage]
    long, kept = _places(path), _places(short)
    assert len(short) <= len(path)
    k = 0
    for place in long:
        near = [j for j in (k, k + 1) if j < len(kept) and np.allclose(kept[j], place, rtol=0, atol=0.0501)]
        assert near, (place, kept[k : k + 2])
        k = near[-1]
    assert k == len(kept) - 1


def test_figures_of_a_page_share_letters_and_styles_and_show_the_same() -> None:
    """Every reference has its target, once; no style is lost, and nothing that was drawn is."""
    drawn = {}
    for name in ("one", "two"):
        figure = Figure()
        axes = figure.subplots()
        axes.plot([0.0, 1.0, 3.0, 2.0] * 5, [1.0, 4.0, 2.0, 2.5] * 5, "o-")
        axes.set_title("speed of a wheel")
        figure.suptitle(name)
        drawn[name] = vector.svg(figure, name)
    shared, common = vector.share(drawn)
    page = common + "".join(shared.values())
    targets = re.findall(r' id="([^"]+)"', page)
    assert len(targets) == len(set(targets))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(targets)
    assert set(re.findall(r"url\(#([^)]+)\)", page)) <= set(targets)
    rules = dict(re.findall(r"\.(s\d+)\{([^}]*)\}", common))
    for name, text in drawn.items():
        styles = re.findall(r'style="([^"]*)"', text)
        now = re.sub(r'class="(s\d+)"', lambda found: f'style="{rules[found[1]]}"', shared[name])
        letters = len(re.findall(r"<path id=\"[\w-]*DejaVu", text))
        assert sorted(re.findall(r'style="([^"]*)"', now)) == sorted(styles)
        assert now.count("<use") == text.count("<use")
        assert now.count("<path") == text.count("<path") - letters
        assert now.count("<g") == now.count("</g>")
