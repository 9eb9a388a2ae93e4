"""The record of the electro-mechanical positioning system: which run is fitted and which is judged."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from suite.case import Held
from suite.measured import Source, run
from suite.record import Record

TRAINED, JUDGED = "DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"
SOURCE = Source(
    folder="emps",
    origin="nonlinearbenchmark.org/benchmarks/emps (Janot, Gautier and Brunot, 2019)",
    sha256={
        TRAINED: "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
        JUDGED: "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
    },
)
EVERY = 4  # one sample in four is fitted; the reference hardly bends in 4 ms (in 10 ms it does: a mass 8 % too large)


def measured(folder: Path | None) -> Record:
    """Without pulses, 250 Hz: u (6211, 2) the reference in m and the pulses in V, y (6211, 1) the motor's voltage."""
    t, qg, vir = (column[::EVERY] for column in SOURCE.columns(folder, TRAINED, ["t", "qg", "vir"]).values())
    return run("EMPS", t, [qg, np.zeros_like(qg)], [vir])


def held_out(folder: Path | None) -> Mapping[str, Held]:
    """With pulses of 5 V added to the controller's voltage, 1 kHz."""
    t, qg, pulses, vir = SOURCE.columns(folder, JUDGED, ["t", "qg", "pulses_N", "vir"]).values()
    return {"pulses": Held(run("EMPS with pulses", t, [qg, pulses], [vir]))}
