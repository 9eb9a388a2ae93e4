"""Models and records as HTML for a notebook: typeset equations, how well numbers are known, a sparkline a column."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt
import sympy
from sympy.printing.mathml import mathml

from suite import expressions
from suite.model import Initial, Model, Parameter
from suite.record import Record

Array = npt.NDArray[np.float64]

WIDE, HIGH = 220, 28  # a sparkline, in pixels
POINTS = 400  # of a sparkline; beyond that the extremes of equal stretches
# The page's own colours, so that a dark notebook stays dark.
LEFT = "text-align:left;padding:.15em .8em .15em 0"
RIGHT = "text-align:right;padding:.15em .8em .15em 0;font-variant-numeric:tabular-nums"


def escaped(text: object) -> str:
    """Text as HTML shows it; control characters, for which XML has no place, as '?'."""
    return html.escape("".join(letter if letter.isprintable() else "?" for letter in str(text)))


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """A table of cells that are HTML already; the columns `numbers` stand at the right."""

    def cells(row: Sequence[str], tag: str) -> str:
        return "".join(f'<{tag} style="{RIGHT if j in numbers else LEFT}">{cell}</{tag}>' for j, cell in enumerate(row))

    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    head = cells([escaped(heading) for heading in headings], "th")
    return f'<table style="border-collapse:collapse"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def formula(expression: sympy.Expr) -> str:
    """An expression as presentation MathML, without the element `math` around it."""
    text = str(mathml(expression, printer="presentation"))
    # The letter itself is right in HTML and in XML; a name such as &InvisibleTimes; is in HTML alone.
    return re.sub(r"&(?!(?:lt|gt|amp|quot);)\w+;", lambda name: html.unescape(name[0]), text)


def typeset(name: str) -> str:
    """A name as a formula of its own."""
    return f"<math>{formula(expressions.symbol(name))}</math>"


def model_html(model: Model) -> str:
    """A model: its equations typeset, its numbers with how well they are known, its first states."""
    rows = []
    for name, rate in zip(model.states, model.rates, strict=True):
        primed = f"<msup>{formula(expressions.symbol(name))}<mo>′</mo></msup>"
        note = "a definition" if name in model.definitions else "" if name in model.suspects else "not in doubt"
        rows.append([_equation(primed, rate), note])
    for name, equation in zip(model.outputs, model.output_expressions, strict=True):
        sigma = model.outputs[name].sigma
        noise = "" if sigma is None else f", noise {sigma:g}"
        said = f"measured in column {model.outputs[name].column}{noise}"
        rows.append([_equation(f"<mi>{escaped(name)}</mi>", equation), escaped(said)])
    parts = [f"<p><strong>{escaped(model.name)}</strong></p>", table(["equation", ""], rows)]
    if model.parameters:
        numbers = [
            [typeset(name), f"{p.value:.6g}", escaped(p.unit or ""), escaped(known(p))]
            for name, p in model.parameters.items()
        ]
        parts.append(table(["parameter", "value", "unit", "known"], numbers, (1,)))
    first = [[typeset(name), escaped(_first(model.initial.get(name)))] for name in model.states]
    parts.append(table(["state", "at the first sample"], first))
    return "".join(parts)


def _equation(left: str, right: sympy.Expr) -> str:
    return f"<math><mrow>{left}<mo>=</mo>{formula(right)}</mrow></math>"


def known(parameter: Parameter) -> str:
    """How well a parameter is known, in words."""
    low, high = parameter.bounds
    between = "" if np.isinf([low, high]).all() else f", between {low:g} and {high:g}"
    sd = parameter.prior_sd
    if parameter.fixed:
        return "exactly"
    if parameter.sd is not None:
        return f"± {sd:.3g}{between}"
    return ("not at all" if np.isinf(sd) else "hardly (± 100 %)") + between


def _first(initial: Initial | None) -> str:
    if initial is None:
        return "estimated, from the data"
    return f"estimated, from {initial.value:g}" if initial.estimate else f"{initial.value:g}"


def record_html(record: Record) -> str:
    """A record: samples, runs, time, and for each column its range, what is missing, and its course."""
    bounds = record.bounds
    steps = np.concatenate([np.diff(run.t) for run in record.runs])
    even = np.ptp(steps) < 1e-6 * np.median(steps)
    runs = "1 run" if len(record.starts) == 1 else f"{len(record.starts)} runs"
    step = f"{'step' if even else 'uneven steps, median'} {np.median(steps):.4g}"
    said = f"{len(record)} samples in {runs}, t = {record.t.min():.6g} to {record.t.max():.6g}, {step}"
    rows = []
    for kind, columns in (("input", record.u), ("output", record.y)):
        for j, values in enumerate(columns.T, start=1):
            there = values[np.isfinite(values)]
            reach = [f"{there.min():.4g}", f"{there.max():.4g}"] if len(there) else ["", ""]
            rows.append([f"{kind} {j}", *reach, str(len(values) - len(there)), sparkline(record.t, values, bounds)])
    named = f"<strong>{escaped(record.source)}</strong>: " if record.source else ""
    return f"<p>{named}{escaped(said)}</p>" + table(["column", "least", "most", "missing", ""], rows, (1, 2, 3))


def sparkline(t: Array, values: Array, bounds: npt.NDArray[np.int64]) -> str:
    """A column over time as a small SVG: the runs one after another, broken between them and where values miss."""
    there = np.isfinite(values)
    low = float(values[there].min()) if there.any() else 0.0
    reach = (float(values[there].max()) - low if there.any() else 0.0) or 1.0
    lengths = t[bounds[1:] - 1] - t[bounds[:-1]]
    begins = np.concatenate([[0.0], np.cumsum(1.03 * lengths)[:-1]])
    scale = WIDE / (float(begins[-1] + lengths[-1]) or 1.0)
    paths = []
    for first, last, begin in zip(bounds[:-1], bounds[1:], begins, strict=True):
        x = (t[first:last] - t[first] + begin) * scale
        y = HIGH - 2 - (HIGH - 4) * (values[first:last] - low) / reach
        share = max(int(POINTS * (last - first) / len(t)), 8)
        for piece in _pieces(x, y):
            kept = _extremes(piece[:, 1], share)
            paths.append("M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in piece[kept]))
    drawn = f'<path d="{"".join(paths)}" fill="none" stroke="#0072B2" stroke-width="1.2"/>'
    return f'<svg width="{WIDE}" height="{HIGH}" viewBox="0 0 {WIDE} {HIGH}" aria-hidden="true">{drawn}</svg>'


def _pieces(x: Array, y: Array) -> list[Array]:
    """Stretches without a missing value, (samples, 2) each; a lone value is a stretch of its own."""
    cuts = np.flatnonzero(np.isnan(y))
    pieces = [piece[~np.isnan(piece[:, 1])] for piece in np.split(np.column_stack([x, y]), cuts)]
    return [np.vstack([p, p + np.array([0.5, 0.0])]) if len(p) == 1 else p for p in pieces if len(p)]


def _extremes(y: Array, most: int) -> npt.NDArray[np.int64]:
    """Indices of at most about `most` values, the least and the largest of equal stretches, so that spikes survive."""
    if len(y) <= most:
        return np.arange(len(y))
    parts = np.array_split(np.arange(len(y)), max(most // 2, 1))
    kept = [index for part in parts for index in (part[y[part].argmin()], part[y[part].argmax()])]
    return np.unique(kept)


def text_of(fragment: str) -> str:
    """What a fragment says without its tags, for a plain terminal and for tests."""
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", fragment))).strip()
