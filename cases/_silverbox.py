"""The record of the silverbox benchmark: which samples are fitted and which are judged."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from suite.case import Held
from suite.measured import Source, run
from suite.record import Record

FILE = "SNLS80mV.csv"
SOURCE = Source(
    folder="silverbox",
    origin="nonlinearbenchmark.org/benchmarks/silverbox (Wigren and Schoukens, 2013)",
    sha256={FILE: "ae62d5a91230c10f76e6dd02c8a4fac3c9d4d8a95fbf50e87cb0c4885003e0f1"},
)
RATE = 1e7 / 2**14  # Hz
LEAD = 50  # samples for the first state, as the benchmark has it
PARTS = {"multisine": (105712, 127400), "arrow": (100, 40575), "arrow without extrapolation": (100, 32100)}


def part(folder: Path | None, first: int, last: int) -> Record:
    """Some samples: u and y (last - first, 1) in volts."""
    u, y = SOURCE.columns(folder, FILE, ["V1", "V2"]).values()
    return run(f"silverbox {first}-{last}", np.arange(last - first) / RATE, [u[first:last]], [y[first:last]])


def measured(folder: Path | None) -> Record:
    """The benchmark's training part: 65,062 samples of multisines."""
    return part(folder, 40650, 105712)


def held_out(folder: Path | None) -> Mapping[str, Held]:
    """A multisine as in training, and the arrow: noise whose amplitude grows beyond what was trained."""
    return {name: Held(part(folder, *bounds), lead=LEAD, first=LEAD) for name, bounds in PARTS.items()}
