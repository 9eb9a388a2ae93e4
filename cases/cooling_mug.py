"""A mug of hot water cools for 222 minutes: Newton's law of cooling is not enough. Measured."""

from pathlib import Path

from suite.case import Case
from suite.measured import numbers, packaged, run
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record


def measured(folder: Path | None) -> Record:
    """CoolingWater of mosaicData: t (222,) in minutes, y (222, 1) in deg C."""
    table = packaged("cooling-mug", "mosaicData", "CoolingWater")
    return run("mosaicData CoolingWater", numbers(table, "time"), [], [numbers(table, "temp")])


CASE = Case(
    name="cooling-mug",
    sentence="A mug of hot water against Newton's law of cooling; the loss grows faster than the difference.",
    deficient=Model(
        name="Newton's law of cooling",
        states={"T": "-k*(T - Ta)"},
        parameters={"k": Parameter(0.02, unit="1/min"), "Ta": Parameter(25.0, unit="degC")},
        outputs={"T": Output("T", column="temp", sigma=0.05)},
        initial={"T": Initial(75.0, estimate=True)},
    ),
    measured=measured,
    noises=(0.0,),
    tags=("measured", "thermal"),
)
