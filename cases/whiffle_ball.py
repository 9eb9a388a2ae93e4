"""A yellow whiffle ball falls 47 m, filmed twice: gravity alone is not enough. Measured."""

from pathlib import Path

from suite.case import Case
from suite.measured import Source, read_runs
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record

SOURCE = Source(
    folder="ball_drops",
    origin="github.com/briandesilva/discovery-of-physics-from-data, data/Ball_drops_data.xls, a CSV file a drop",
    sha256={
        "yellow_whiffle_ball_drop1.csv": "0cd36c9d8d91dc906de6b88d98f54030990d74165b1d161e69dcf13c7ec18877",
        "yellow_whiffle_ball_drop2.csv": "ae91a8ca0b293812600bfce64f59eb8fa53103f2255a15c96b0c976e063fc5e6",
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
        initial={"z": Initial(47.0, estimate=True), "v": Initial(0.0)},
    ),
    measured=measured,
    noises=(0.0,),
)
