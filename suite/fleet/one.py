"""The task of one file: its verdict as a flat row, or why there is none."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from suite import plugins
from suite.benchmark.cells import peak
from suite.discovery import words
from suite.discovery.result import Verdict
from suite.discovery.verdict import diagnose
from suite.errors import InputError
from suite.model import Model
from suite.model_file import from_toml
from suite.readers import read_record
from suite.record import Record

# Models kept by a process; a run has one, a Dask worker may serve several runs.
KEPT = 8
TEXTS = ("verdict", "effects", "term", "missing", "coefficients", "sentence", "plausible")


def run(text: str, source: str, path: str, absolute: bool) -> dict[str, Any]:
    """The row of the file at `path` under the model in `text` (of a file called `source`).

    `status` is ok, or refused with the `reason` in a sentence; `digest` is that of the bytes that were there.
    """
    row: dict[str, Any] = {"status": "ok", "reason": "", "digest": digest(path)}
    # What numerics meet on the way is no news; its outcome is.
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            model = _model(text, source)
            record = read_record(path, model)
            found = diagnose(model, record, plugins.effects(), absolute)
        except InputError as error:
            return {**row, **dict.fromkeys(TEXTS, ""), "status": "refused", "reason": str(error)}
    return {**row, **said(found, record)}


def digest(path: str) -> str:
    """A hash of a file's bytes; of a file that cannot be read, the reason."""
    if not Path(path).is_file():
        # Opening a pipe would wait for its writer.
        return "no ordinary file"
    try:
        with Path(path).open("rb") as handle:
            return hashlib.file_digest(handle, "sha256").hexdigest()[:16]
    except OSError as error:
        return f"unreadable: {error.strerror}"


@lru_cache(maxsize=KEPT)
def _model(text: str, source: str) -> Model:
    """One Model for one text, and with it all that is compiled for it."""
    return from_toml(text, source)


def said(found: Verdict, record: Record) -> dict[str, Any]:
    """A verdict as a row: text and numbers, errors as a table by output.

    `ratio` is the largest error before over noise of any output, the error being that of the calibrated model.
    """
    before, noise = found.error["before"], found.error["noise"]
    ratios = {name: _over(float(value), float(noise[name])) for name, value in before.items()}
    told = found.to_json()
    return {
        "verdict": found.verdict,
        "effects": " + ".join(f"{named.effect}@{named.equation}" for named in found.effects),
        "term": " + ".join(named.term for named in found.effects),
        "missing": " and ".join(words.effect(named) for named in found.effects),
        "coefficients": json.dumps(
            [{k: e[k] for k in ("effect", "equation", "coefficients")} for e in told["effects"]]
        ),
        "weight": found.weight,
        "sentence": found.sentence,
        "plausible": "; ".join(
            f"{' + '.join(f'{n.effect}@{n.equation}' for n in c.effects)} {words.weight(c.weight)}"
            for c in found.plausible
        ),
        "lambda": found.detection["lambda"],
        "ljung_box_p": found.detection["ljung_box_p"],
        "samples": len(record),
        "seconds": found.seconds,
        # The largest so far of the process, which may have done other files before.
        "peak_mb": peak(),
        "ratio": max(ratios.values()),
        "error_before": _floats(before),
        "error_after": _floats(found.error["after"]),
        "noise": _floats(noise),
        "error_over_noise": ratios,
    }


def _over(error: float, noise: float) -> float:
    """Error over noise; infinite where the simulation ran away."""
    if not np.isfinite(error):
        return float("inf")
    return error / noise if noise > 0 else float("inf") if error > 0 else 1.0


def _floats(values: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items()}
