"""A whiffle ball falls 47 m, filmed twice: gravity alone is not enough. Measured."""

from pathlib import Path

from suite.case import Case
from suite.measured import Source, read_runs
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record

SOURCE = Source(
    folder="ball_drops",
    origin="github.com/briandesilva/discovery-of-physics-from-data, data/Ball_drops_data.xls, a CSV file a drop",
    sha256={
        "whiffle_ball_1_drop1.csv": "11abd9df6a74d2e9b4c9800d7adbb7187d5af20858ec0536b34125ea14f04398",
        "whiffle_ball_1_drop2.csv": "c9f8dd0fa7ef5419a84702e5ba1bd3867b0675c43d9b5a3d85220d76e9a12e19",
    },
)


def measured(folder: Path | None) -> Record:
    """Two runs: t in seconds, y (N, 1) the height in m."""
    return read_runs(SOURCE, folder, "t", ["height"])


CASE = Case(
    name="whiffle-ball",
    sentence="Two drops of a whiffle ball against free fall; the air's drag is missing.",
    deficient=Model(
        name="free fall",
        states={"z": "v", "v": "-g"},
        parameters={"g": Parameter(9.81, fixed=True, unit="m/s^2")},
        outputs={"z": Output("z", column="height")},
        initial={"z": Initial(47.0, estimate=True), "v": Initial(0.0, estimate=True)},
    ),
    measured=measured,
    noises=(0.0,),
)
