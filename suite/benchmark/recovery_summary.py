"""What the recovery benchmark reached: each demand with its figure, interval and whether it is met; by case; by method.

A cell that failed counts as a wrong answer; one that was skipped is counted and left out. Shares have Wilson intervals,
other figures bootstrap ones. "merged" counts a look-alike of the truth, one function on these data, as the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from suite.benchmark import table
from suite.benchmark.conditions import NULLS, SPOILED
from suite.benchmark.recovery import OURS
from suite.benchmark.statistics import resampled, wilson

Row = Mapping[str, Any]
Test = Callable[[float], bool]

SEPARABLE = 16.0  # delta^2 from which the truth can be told
SURE = 0.9  # weight from which a verdict counts as certain
WHITE = 0.01  # Ljung-Box p from which a residual counts as white
POWER = 3.29  # deviations of a chi-square statistic that a test of 5 % sees with a chance of 95 %
FEW, SHORT = 50, 1000  # candidates and samples for which the time is stated


def chosen(rows: Iterable[Row], cells: Iterable[Any] = ()) -> list[Row]:
    """The rows of the recovery benchmark, of a plan's cells alone where they are given (any seed)."""
    wanted = {(c.case, c.noise, c.estimator, c.variant) for c in cells}
    return [
        row for row in rows
        if row.get("kind") == "recovery"
        and (not wanted or (row["case"], row["noise"], row["estimator"], row["variant"]) in wanted)
    ]  # fmt: skip


def targets(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Every demand on our verdict: {"id", "what", "figure", "low", "high", "count", "target", "reached", "note"}.

    `reached` is None where nothing was counted.
    """
    mine = [row for row in rows if row["estimator"] == OURS and row["status"] != "skipped"]
    missing = [row for row in mine if row["variant"] == "missing"]
    alone, pairs = _with(missing, 1), _with(missing, 2)
    nulls = [row for row in mine if row["variant"] in NULLS]
    outside = [row for row in mine if row["variant"] == "outside"]
    plain = [row for row in mine if row["variant"] not in SPOILED]
    stated = [row for row in missing if row.get("verdict") in ("missing_effect", "ambiguous")]
    clear = [row for row in alone if _value(row, "delta2") >= SEPARABLE]
    clear_merged = [row for row in alone if _value(row, "delta2_merged") >= SEPARABLE]
    quiet = [row for row in alone if row["noise"] == 0.01]
    told = [row for row in pairs if _value(row, "delta2_merged") >= SEPARABLE]
    beyond = [row for row in outside if _value(row, "delta2") >= SEPARABLE]
    sure = [row for row in plain if certain(row)]
    z = np.array([value for row in missing for value in (row.get("z") or {}).values()])
    left = np.array([row["residual"] for row in stated if row.get("residual") is not None])
    quick = [row for row in plain if row.get("candidates", 99) <= FEW and row.get("samples", 9999) <= SHORT]
    # Processor time: other cells run beside this one. A search for a second effect has a demand of its own.
    timed = [row for row in quick if row.get("cpu_seconds") is not None]
    one = np.array([row["cpu_seconds"] for row in timed if not sought(row)])
    two = np.array([row["cpu_seconds"] for row in timed if sought(row)])
    inside = [row for row in sure if row["variant"] != "outside"]
    far = [row for row in sure if row["variant"] == "outside" and _value(row, "delta2") >= SEPARABLE]
    plain_to_see = [row for row in outside if visible(row)]
    sure_outside = [row for row in sure if row["variant"] == "outside" and visible(row)]
    band = "0.92 to 0.97"
    return [
        _share("first, delta2 >= 16", "true effect first, where delta^2 >= 16", clear, "first", ">= 0.95"),
        _share("first, delta2 >= 16, merged", "  look-alikes as one", clear_merged, "first_merged", ">= 0.95"),
        _share("first, 1 %", "true effect first at 1 % noise, all", quiet, "first", ">= 0.97"),
        _share("first, 1 %, merged", "  look-alikes as one", quiet, "first_merged", ">= 0.97"),
        _share("plausible", "truth in the stated plausible set", stated, "in_plausible", ">= 0.99"),
        _share("plausible, merged", "  look-alikes as one", stated, "in_plausible_merged", ">= 0.99"),
        _share("certain and wrong", "verdicts with weight > 0.9 that are wrong", sure, wrong, "<= 0.02"),
        _share("certain and wrong, inside", "  where the library holds the truth", inside, wrong, "<= 0.02"),
        _share("certain and wrong, outside", "  outside it, every stand-in 16 away", far, wrong, "<= 0.02"),
        _share("certain and wrong, visible", "  outside it, the nearest one visible", sure_outside, wrong, "<= 0.02"),
        _figure("z", "coefficient rms error / Cramer-Rao sd", z, _rms, "<= 1.2"),
        _counted("cover", "95 % intervals that cover", int((np.abs(z) < 1.96).sum()), len(z), band),
        _share("false alarm", "false alarm on complete models", nulls, "alarm", "<= 0.02"),
        _share("none of these", "'none explains it' for an effect outside the library", outside, unexplained, ">= 0.9"),
        _share("none of these, outright", "  said as its verdict", outside, outright, ">= 0.9"),
        _share("none of these, far", "  where every stand-in is 16 away", beyond, unexplained, ">= 0.9"),
        _share("none of these, visible", "  where the nearest one is visible", plain_to_see, unexplained, ">= 0.9"),
        _figure("residual", "residual / sigma with the named effect, median", left, _median, "0.95 to 1.05"),
        _share("white", "residual white (Ljung-Box p >= 0.01)", stated, white, ">= 0.95"),
        _share("pairs", "two effects exact, where delta^2 >= 16", told, "exact_merged", ">= 0.8"),
        _figure("seconds", "processor seconds a verdict, 95 of 100 within", one, _most, "<= 2"),
        _figure("seconds, second", "  where a second effect was sought", two, _most, "<= 12"),
    ]


def visible(row: Row) -> bool:
    """Whether a chi-square test of the residual, which knows no rival, would refuse the nearest stand-in for a truth
    outside the library in 95 of 100 records, at 5 % of false alarms: delta^2 against the test's deviation sqrt(2 N).
    """
    return _value(row, "delta2") >= POWER * float(np.sqrt(2.0 * row.get("measurements", np.inf)))


def sought(row: Row) -> bool:
    """Whether pairs of effects were fitted; a row that does not say so is taken for what it should have been."""
    return int(row.get("depth") or (2 if row["variant"] == "outside" or "+" in row.get("missing", "") else 1)) > 1


def certain(row: Row) -> bool:
    """Whether a row names effects and is sure of them."""
    return bool(row.get("named")) and _value(row, "weight") > SURE


def wrong(row: Row) -> bool:
    """Whether the effects that a row names are not the missing ones, nor a look-alike of them."""
    return not row.get("exact_merged", False)


def outright(row: Row) -> bool:
    """Whether the verdict itself is that nothing in the library explains it."""
    return row.get("verdict") == "unexplained"


def unexplained(row: Row) -> bool:
    """Whether the verdict holds it likeliest that nothing in the library explains it: it says so, or gives "none of
    these" more weight than any hypothesis.
    """
    weights = list(row.get("plausible_weights") or [])
    none = 1.0 - sum(weights)
    likeliest = row.get("verdict") == "ambiguous" and none > max(weights, default=1.0)
    return outright(row) or likeliest


def white(row: Row) -> bool:
    """Whether the residual with the named effect is white."""
    return _value(row, "ljung_box_after") >= WHITE


def by_case(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Our verdict, one line a case, condition and noise."""
    lines = []
    for (case, condition, noise), group in _groups(rows, ("case", "variant", "noise"), OURS).items():
        judged = [row for row in group if row["status"] != "skipped"]
        line: dict[str, Any] = {"case": case, "condition": condition, "noise": noise, "seeds": len(judged)}
        line["failed"] = sum(row["status"] != "ok" for row in judged)
        line["missing"] = next((row["missing"] for row in group if row.get("missing")), "")
        if condition not in NULLS:
            line |= {key: _mean(judged, key) for key in ("first_merged", "exact_merged", "in_plausible_merged")}
            line["delta2"] = _middle(judged, "delta2_merged")
        line["alarm"] = _mean(judged, "alarm")
        line["unexplained"] = sum(map(unexplained, judged)) / len(judged) if judged else None
        line["certain_wrong"] = sum(certain(row) and wrong(row) for row in judged)
        line["seconds"] = _middle(judged, "seconds")
        line["reason"] = next((row["reason"] for row in group if row.get("reason")), "")
        lines.append(line)
    return lines


def by_condition(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Our verdict, one line a condition: how often it was certain, and how often of those wrong."""
    lines = []
    for (condition,), group in _groups(rows, ("variant",), OURS).items():
        judged = [row for row in group if row["status"] != "skipped"]
        sure = [row for row in judged if certain(row)]
        share, low, high = wilson(sum(map(wrong, sure)), len(sure))
        lines.append({
            "condition": condition, "verdicts": len(judged), "alarm": _mean(judged, "alarm"),
            "exact_merged": None if condition in NULLS else _mean(judged, "exact_merged"), "certain": len(sure),
            "certain_wrong": share, "low": low, "high": high,
        })  # fmt: skip
    return lines


def by_method(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Each method on the records that something is missing in, one line a noise: the true effect first, the exact
    structure; beside it our exact structures on the very same records, and the alarms on complete models.
    """
    lines = []
    ours = {_record(row): row for row in rows if row["estimator"] == OURS}
    for (method, noise), group in _groups(rows, ("estimator", "noise")).items():
        judged = [row for row in group if row["status"] != "skipped" and row["variant"] == "missing"]
        nulls = [row for row in group if row["status"] != "skipped" and row["variant"] == "null-right"]
        line: dict[str, Any] = {"method": method, "noise": noise, "records": len(judged)}
        line["skipped"] = sum(row["status"] == "skipped" for row in group if row["variant"] == "missing")
        line["failed"] = sum(row["status"] != "ok" for row in judged)
        for key in ("first", "exact"):
            share, low, high = wilson(sum(bool(row.get(key)) for row in judged), len(judged))
            line |= {key: share, f"{key}_low": low, f"{key}_high": high}
        line["ours_exact"] = _mean([ours[_record(row)] for row in judged if _record(row) in ours], "exact")
        line |= {"false_alarm": _mean(nulls, "alarm"), "seconds": _middle(judged, "seconds")}
        line["reason"] = next((row["reason"] for row in group if row.get("reason")), "")
        lines.append(line)
    return sorted(lines, key=lambda line: (line["method"] != OURS, line["method"], line["noise"]))


def _record(row: Row) -> tuple[Any, ...]:
    return row["case"], row["noise"], row["variant"], row["seed"]


def _groups(rows: Sequence[Row], keys: tuple[str, ...], method: str | None = None) -> dict[tuple[Any, ...], list[Row]]:
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if method is None or row["estimator"] == method:
            found.setdefault(tuple(row[key] for key in keys), []).append(row)
    return dict(sorted(found.items()))


def _with(rows: Sequence[Row], count: int) -> list[Row]:
    """The rows with so many effects missing; one that failed before that was known counts as one."""
    return [row for row in rows if row.get("missing", "").count("+") + 1 == count]


def _value(row: Row, key: str) -> float:
    value = row.get(key)
    return float("nan") if value is None else float(value)


def _mean(rows: Sequence[Row], key: str) -> float | None:
    return sum(bool(row.get(key)) for row in rows) / len(rows) if rows else None


def _middle(rows: Sequence[Row], key: str) -> float | None:
    values = [row[key] for row in rows if row.get(key) is not None]
    return float(np.median(values)) if values else None


def _rms(z: Any) -> Any:
    return np.sqrt(np.mean(z**2, axis=-1))


def _median(values: Any) -> Any:
    return np.median(values, axis=-1)


def _most(values: Any) -> Any:
    return np.quantile(values, 0.95, axis=-1)


def _share(name: str, what: str, rows: Sequence[Row], hit: str | Callable[[Row], bool], target: str) -> dict[str, Any]:
    test = (lambda row: bool(row.get(hit))) if isinstance(hit, str) else hit
    failed = sum(row["status"] != "ok" for row in rows)
    entry = _counted(name, what, sum(map(test, rows)), len(rows), target)
    return entry | {"note": f"{failed} of them failed" if failed else ""}


def _counted(name: str, what: str, hits: int, count: int, target: str) -> dict[str, Any]:
    return _entry(name, what, wilson(hits, count), count, target)


def _figure(name: str, what: str, values: Any, figure: Callable[[Any], Any], target: str) -> dict[str, Any]:
    return _entry(name, what, resampled(values, figure), len(values), target)


def _entry(name: str, what: str, figure: tuple[float, float, float], count: int, target: str) -> dict[str, Any]:
    value, low, high = figure
    entry: dict[str, Any] = {"id": name, "what": what, "figure": value, "low": low, "high": high, "count": count}
    return entry | {"target": target, "reached": meets(value, target) if count else None, "note": ""}


def meets(value: float, target: str) -> bool:
    """Whether a figure is ">= a", "<= a" or within "a to b"."""
    words = target.split()
    if words[0] == ">=":
        return value >= float(words[1])
    return value <= float(words[1]) if words[0] == "<=" else float(words[0]) <= value <= float(words[2])


def written(rows: Sequence[Row]) -> dict[str, list[list[str]]]:
    """The tables as cells of text by heading; the first row of each is its heading."""
    reached = {True: "yes", False: "NO", None: "-"}
    first = [["demand", "figure", "95 %", "of", "target", "reached", ""]]
    for t in targets(rows):
        known = t["count"] > 0
        span = f"{t['low']:.3g} to {t['high']:.3g}" if known else ""
        figure = f"{t['figure']:.3g}" if known else ""
        first.append([t["what"], figure, span, str(t["count"]), t["target"], reached[t["reached"]], t["note"]])
    tables = {"What must be reached": first}
    for heading, lines in (
        ("By method, where something is missing", by_method(rows)),
        ("By condition", by_condition(rows)),
        ("By case", by_case(rows)),
    ):
        if lines:
            names = list(dict.fromkeys(name for line in lines for name in line))
            tables[heading] = [names, *([_cell(line.get(name)) for name in names] for line in lines)]
    return tables


def text(rows: Sequence[Row]) -> str:
    """All tables as plain text."""
    return "\n\n".join(f"{heading}\n{table.grid(cells)}" for heading, cells in written(rows).items())


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.3g}"
    return "" if value is None else str(value)[:60]
