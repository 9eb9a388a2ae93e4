"""What the page draws, as plain numbers: finite or None, times to draw at, long records thinned so that spikes stay."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from suite.record import Record
from suite.report.canvas import thinned_runs, timeline

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

MOST = 2000  # points of a trace


def text(thing: Any) -> str:
    """JSON; None where a number is not finite, since JSON has no other word for it."""
    return json.dumps(_finite(thing), ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _finite(thing: Any) -> Any:
    if isinstance(thing, Mapping):
        return {str(key): _finite(value) for key, value in thing.items()}
    if isinstance(thing, np.ndarray):
        return _finite(thing.tolist())
    if isinstance(thing, list | tuple):
        return [_finite(value) for value in thing]
    if isinstance(thing, np.generic):
        return _finite(thing.item())
    if isinstance(thing, float) and not math.isfinite(thing):
        return None
    return thing


def trace(record: Record, values: Array) -> dict[str, list[float | None]]:
    """A curve over time {"t", "y"}: values (N,) thinned to about 2,000 points, with a gap between runs."""
    t, _ = timeline(record)
    times: list[float | None] = []
    shown: list[float | None] = []
    for k, kept in enumerate(thinned_runs(record, values, MOST)):
        if k:
            # A line must not run from the end of one run to the start of the next.
            times.append(times[-1])
            shown.append(None)
        times += t[kept].tolist()
        shown += digits(values[kept])
    return {"t": times, "y": shown}


def kept_samples(record: Record, values: Array) -> tuple[Index, Index]:
    """At most about 2,000 samples by the extremes of values (N,), and the run that each belongs to."""
    parts = thinned_runs(record, values, MOST)
    runs = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return np.concatenate(parts), runs.astype(np.int64)


def runs(record: Record, names: Sequence[str]) -> list[dict[str, Any]]:
    """Each run's name and the times between which it is drawn."""
    t, _ = timeline(record)
    spans = zip(record.bounds[:-1].tolist(), record.bounds[1:].tolist(), strict=True)
    return [{"name": name, "t0": float(t[a]), "t1": float(t[b - 1])} for name, (a, b) in zip(names, spans, strict=True)]


def digits(values: Array) -> list[float | None]:
    """Numbers with nine digits, which no screen tells from sixteen."""
    return [float(f"{value:.9g}") if math.isfinite(value) else None for value in values.tolist()]
