"""The matrix of the report: error over the reference's by condition and method, as cells with a number and a colour."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from suite.benchmark.comparison import Comparison, Condition, Method
from suite.benchmark.ranking import not_beaten

SPAN = 3.0  # colours reach from 1/8 to 8 of the reference, in equal steps of the logarithm


@dataclass(frozen=True)
class Square:
    """A cell: what it says, a remark on failures, its colours, whether it is among the best, the tooltip."""

    text: str
    remark: str = ""
    background: str = ""
    dark: bool = False
    best: bool = False
    title: str = ""


@dataclass(frozen=True)
class Matrix:
    """A table of squares: columns of methods, then of reference rows; a line a condition.

    `testable` says whether the seeds suffice for the test behind the bold numbers.
    """

    variant: str
    methods: Sequence[Method]
    references: Sequence[Method]
    lines: Sequence[tuple[Condition, Sequence[Square], Sequence[Square]]]
    testable: bool


def matrix(c: Comparison, variant: str) -> Matrix | None:
    """The matrix of a variant; None where the reference or the variant is not in the store."""
    methods = c.methods(variant)
    if not methods or c.reference is None or (variant == "tuned" and not any(m.variant == "tuned" for m in methods)):
        return None
    references = sorted(c.references, key=lambda m: m.label)
    lines, able = [], []
    for at in c.conditions:
        best, equals, testable = not_beaten({m: c.by_seed(m, at) for m in methods})
        bold = equals if testable else {best}
        able.append(testable)
        lines.append(
            (at, [_square(c, m, at, m in bold) for m in methods], [_square(c, m, at, False) for m in references])
        )
    return Matrix(variant, methods, references, lines, any(able))


def _square(c: Comparison, method: Method, at: Condition, best: bool) -> Square:
    rows = c.of(method).get(at, ())
    if not rows:
        return Square("", title="not run")
    ended = Counter(row["status"] for row in rows)
    reason = next((str(row["reason"]) for row in rows if row["reason"]), "")
    failed = len(rows) - ended["ok"]
    worst = next((status for status, _ in ended.most_common() if status != "ok"), "")
    if ended["skipped"] == len(rows):
        return Square("–", title=f"does not apply: {reason}")
    remark = f"{worst} {failed}/{len(rows)}" if failed else ""
    if ended["ok"] == 0:
        return Square("", remark, "#e3e3e3", title=reason)
    assert c.reference is not None
    ratio = c.ratio(method, c.reference, at)
    if ratio is None:
        return Square("?", remark, title="the reference gave no number here")
    if np.isinf(ratio):
        return Square("", remark, "#e3e3e3", best=best, title=reason)
    background, dark = color(ratio)
    return Square(written(ratio), remark, background, dark, best, reason)


def written(ratio: float) -> str:
    """A ratio in at most four characters."""
    if ratio >= 99.5:
        return ">99"
    return f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.1f}" if ratio >= 1.995 else f"{ratio:.2f}"


def color(ratio: float) -> tuple[str, bool]:
    """Background of a ratio, and whether its text must be white: purple is better, orange worse, white equal.

    Purple and orange are told apart with every kind of colour vision.
    """
    share = 0.5 + 0.5 * float(np.clip(np.log2(max(ratio, 1e-9)) / SPAN, -1.0, 1.0))
    rgba: Any = colormaps["PuOr_r"](0.06 + 0.88 * share)
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgba[:3]]
    luminance = float(np.dot(linear, [0.2126, 0.7152, 0.0722]))
    # Where the contrasts of white and of black are equal (WCAG 2), 4.6 each.
    return to_hex(rgba), luminance + 0.05 < np.sqrt(1.05 * 0.05)


def scale() -> list[tuple[str, str, bool]]:
    """The key of the colours: label, background, white text."""
    steps = (("1/8", 0.125), ("1/4", 0.25), ("1/2", 0.5), ("1", 1.0), ("2", 2.0), ("4", 4.0), ("8", 8.0))
    return [(label, *color(ratio)) for label, ratio in steps]


def as_rows(found: Matrix, c: Comparison) -> list[dict[str, Any]]:
    """The matrix as lines of a table file: the ratio, seeds that ended well, and whether it is among the best."""
    assert c.reference is not None
    return [
        {
            "case": at[0], "noise": at[1], "estimator": method.estimator, "variant": method.variant,
            "ratio": c.ratio(method, c.reference, at), "best": square.best, "seeds": len(c.rows[method].get(at, ())),
            "ok": sum(row["status"] == "ok" for row in c.rows[method].get(at, ())),
        }
        for at, squares, _ in found.lines for method, square in zip(found.methods, squares, strict=True)
    ]  # fmt: skip
