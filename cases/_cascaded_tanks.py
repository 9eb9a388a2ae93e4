"""The record of the cascaded tanks: which part is fitted and which is judged."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from suite.case import Held
from suite.measured import Source, run
from suite.record import Record

FILE = "dataBenchmark.csv"
SOURCE = Source(
    folder="cascaded_tanks",
    origin="4TU.ResearchData, doi 10.4121/12960104 (Schoukens, Mattsson, Wigren and Noel, 2020)",
    sha256={FILE: "ef2388ed822f3aef4aa80d6b0f2b466dd80b361786b3eafc7a2957c31ea323a7"},
)
STEP, SAMPLES = 4.0, 1024  # seconds


def part(folder: Path | None, name: str) -> Record:
    """Est or Val: u (1024, 1) the pump's voltage, y (1024, 1) the lower tank's level, in volts."""
    u, y = SOURCE.columns(folder, FILE, [f"u{name}", f"y{name}"]).values()
    return run(f"tanks {name}", np.arange(SAMPLES, dtype=np.float64) * STEP, [u[:SAMPLES]], [y[:SAMPLES]])


def measured(folder: Path | None) -> Record:
    """The benchmark's estimation part."""
    return part(folder, "Est")


def held_out(folder: Path | None) -> Mapping[str, Held]:
    """Its validation part, scored after the benchmark's 50 samples for the first levels."""
    return {"validation": Held(part(folder, "Val"), lead=50, first=50)}
