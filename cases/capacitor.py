"""A capacitor discharges through a resistor for a second: is one exponential enough? Measured."""

from collections.abc import Mapping
from pathlib import Path

from suite.case import Case, Held
from suite.measured import numbers, packaged, run
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record

FITTED = 35  # of 50 samples; the rest is predicted


def whole(folder: Path | None) -> Record:
    """Volts of Stat2Data: t (50,) in seconds, y (50, 1) in volts."""
    table = packaged("capacitor", "Stat2Data", "Volts")
    return run("Stat2Data Volts", numbers(table, "Time"), [], [numbers(table, "Voltage")])


def held_out(folder: Path | None) -> Mapping[str, Held]:
    """The last 0.3 s, predicted from what went before."""
    return {"last 30 %": Held(whole(folder), lead=FITTED, first=FITTED)}


CASE = Case(
    name="capacitor",
    sentence="A capacitor discharges through a resistor; one exponential towards zero is not enough.",
    deficient=Model(
        name="RC circuit",
        states={"V": "-k*V"},
        parameters={"k": Parameter(2.0, unit="1/s")},
        outputs={"V": Output("V", column="Voltage")},
        initial={"V": Initial(9.0, estimate=True)},
    ),
    measured=lambda folder: whole(folder).part(0, FITTED),
    noises=(0.0,),
    held_out=held_out,
    tags=("measured", "electrical"),
)
