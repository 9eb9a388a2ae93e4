"""The report of the benchmark: one page that opens anywhere, its figures and its tables, from stored rows alone."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from suite import plugins
from suite.benchmark import findings, table
from suite.benchmark.comparison import Comparison, Method, compare
from suite.benchmark.statistics import is_reference
from suite.errors import InputError
from suite.files import writable_folder, write_whole
from suite.report import bench_cases, bench_consistency, bench_origin, bench_ranking, bench_sensitivity
from suite.report.bench_figures import STYLE
from suite.report.bench_matrix import Matrix, as_rows, matrix, scale
from suite.report.vector import share, svg

Row = Mapping[str, Any]
POINTS = 50_000  # of all curves of the pictures of cases together, at about 12 bytes each


def write(rows: Sequence[Row], tunings: Sequence[Mapping[str, Any]], folder: Path, store: str) -> dict[str, Any]:
    """Write report.html, verdict.txt, figures/*.svg and the tables; {"verdict": sentences, "files": paths}."""
    rows = [row for row in rows if row.get("kind") != "recovery"]
    c = compare(rows)
    if not c.rows:
        raise InputError(f"{store} holds no estimate to report; make some with: unmodelled bench run --store {store}")
    writable_folder(folder)
    points = bench_sensitivity.points(tunings)
    figures = {name: figure for name, figure in _figures(c, points).items() if figure is not None}
    most = int(np.clip(POINTS / (10 * max(len(c.cases), 1)), 60, 400))
    pictures = [bench_cases.picture(c, case, most) for case in c.cases]
    figures |= {f"case-{p.case}": p.figure for p in pictures if p.figure is not None}
    drawn = {name: svg(figure, name) for name, figure in figures.items()}
    for name, text in drawn.items():
        write_whole(folder / "figures" / f"{name}.svg", text)
    sentences = findings.verdict(c)
    matrices = [found for variant in ("tuned", "default") if (found := matrix(c, variant)) is not None]
    write_whole(folder / "report.html", _page(c, rows, sentences, matrices, pictures, drawn, figures, store))
    write_whole(folder / "verdict.txt", "\n\n".join(sentences) + "\n")
    files = [folder / "report.html", folder / "verdict.txt", *(folder / "figures" / f"{name}.svg" for name in drawn)]
    files += _tables(c, rows, matrices, points, folder)
    return {"verdict": sentences, "files": [str(path) for path in files]}


def _figures(c: Comparison, points: Sequence[Mapping[str, Any]]) -> dict[str, Figure | None]:
    if not c.conditions:
        return {}
    with mpl.rc_context(STYLE):
        return {
            "performance-profile": bench_ranking.performance_profile(c),
            "critical-difference-tuned": bench_ranking.critical_differences(c, "tuned"),
            "critical-difference-shipped": bench_ranking.critical_differences(c, "default"),
            "accuracy-against-time": bench_ranking.pareto(c),
            "consistency": bench_consistency.consistency(c),
            "sensitivity": bench_sensitivity.sensitivity(points),
        }


def _tables(
    c: Comparison, rows: Sequence[Row], matrices: Sequence[Matrix], points: Sequence[Row], folder: Path
) -> list[Path]:
    """The tables behind the page; those that are empty are left out."""
    summary = table.lines(rows)
    lines = {tuple(sorted(line.items(), key=str)): line for found in matrices for line in as_rows(found, c)}
    wanted: dict[str, Sequence[Row]] = {
        "rows.parquet": rows,
        "summary.csv": summary,
        "summary.parquet": summary,
        "methods.csv": methods(c),
        "matrix.csv": list(lines.values()),
        "failures.csv": bench_origin.failures(rows),
        "tuning-points.csv": points,
    }
    paths = []
    for name, shown in wanted.items():
        if shown:
            table.write(shown, folder / "tables" / name)
            paths.append(folder / "tables" / name)
    return paths


def methods(c: Comparison) -> list[dict[str, Any]]:
    """A line a method, best mean rank first; reference rows last, without a rank."""
    found = []
    order = c.methods()
    means = c.ranks(order).mean(axis=1) if order and c.conditions else np.full(len(order), np.nan)
    extra = list(plugins.metrics())
    for method, mean in (*zip(order, means, strict=True), *((m, None) for m in c.references)):
        counts = c.counts(method)
        ratio = c.over_cases(method, c.reference) if c.reference is not None else None
        line: dict[str, Any] = {
            "method": method.label, "estimator": method.estimator, "variant": method.variant, "kind": method.kind,
            "family": "reference" if mean is None else method.family, "mean_rank": mean,
        }  # fmt: skip
        line |= dict(zip(("ratio", "ratio_low", "ratio_high"), ratio or (None, None, None), strict=True))
        fields = ("d_nrmse", "parameter_worst", "J", "J_data", "J_model", "nees", "nis", "step_us", "peak_mb", *extra)
        line |= {field: c.median_of(method, field) for field in fields}
        line["named"] = _share(c, method)
        ran = sum(counts.values()) - counts.get("skipped", 0)
        found.append({**line, "failed": ran - counts.get("ok", 0), "ran": ran, "skipped": counts.get("skipped", 0)})
    return found


def _share(c: Comparison, method: Method) -> float | None:
    """How often the shape of the missing effect was recognised, of the cells where that was asked."""
    hits = [
        row["named"]
        for rows in c.of(method).values()
        for row in rows
        if row["status"] == "ok" and row.get("named") is not None
    ]
    return float(np.mean(hits)) if hits else None


def _page(
    c: Comparison,
    rows: Sequence[Row],
    sentences: Sequence[str],
    matrices: Sequence[Matrix],
    pictures: Sequence[bench_cases.Picture],
    drawn: Mapping[str, str],
    figures: Mapping[str, Figure],
    store: str,
) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    shared, letters = share(drawn)
    failed = bench_origin.failures(rows)
    measured = sorted({row["case"] for row in rows} - set(c.cases))
    commands = bench_origin.commands(c, store)
    first, last = bench_origin.dates(rows)
    return environment.get_template("bench.html.j2").render(
        sentences=sentences,
        matrices=matrices,
        variants=bench_ranking.VARIANTS,
        scale=scale(),
        figures={name: Markup(text) for name, text in shared.items()},
        says={name: html.unescape(str(figure.get_label())) for name, figure in figures.items()},
        letters=Markup(letters),
        methods=methods(c),
        winners=findings.winners(c),
        pictures=pictures,
        metrics=[metric for name, metric in plugins.metrics().items() if any(name in row for row in rows)],
        metric_errors=bench_origin.metric_errors(rows),
        columns=table.COLUMNS,
        failures=[entry for entry in failed if entry["status"] != "skipped"],
        refusals=[entry for entry in failed if entry["status"] == "skipped"],
        most=bench_origin.MOST,
        measured=measured,
        references=any(is_reference(row) for row in rows),
        seeds=c.seeds,
        cells=len(rows),
        cases=c.cases,
        commands=commands,
        plan=bench_origin.plan_text(c) if "PLAN.toml" in commands[0] else "",
        versions=bench_origin.versions(rows),
        hashes=bench_origin.hashes(rows),
        first=first,
        last=last,
    )


def number(value: Any) -> str:
    """A number in three digits, nothing where there is none."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return ""
    if isinstance(value, float) and np.isinf(value):
        return "failed"
    text = f"{value:.3g}"
    return f"{float(text):.0f}" if "e+0" in text else text
