"""What the cases of falling balls share: a drop from 47 m filmed at 15 Hz, free fall, drop 1 fitted, drop 2 judged."""

from collections.abc import Mapping
from pathlib import Path

from suite.case import Case, Held
from suite.measured import Source, read_runs
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record

ORIGIN = "github.com/briandesilva/discovery-of-physics-from-data, data/Ball_drops_data.xls, a CSV file a drop"


def source(file: str, sums: tuple[str, str]) -> Source:
    """The two drops of a ball."""
    return Source("ball_drops", ORIGIN, {f"{file}_drop{i}.csv": value for i, value in enumerate(sums, start=1)})


def drops(source: Source, folder: Path | None) -> Record:
    """Two runs: t in seconds, y (N, 1) the height in m."""
    return read_runs(source, folder, "t", ["height"])


FREE_FALL = Model(
    name="free fall",
    states={"z": "v", "v": "-g"},
    parameters={"g": Parameter(9.81, fixed=True, unit="m/s^2")},
    outputs={"z": Output("z", column="height")},
    initial={"z": Initial(47.0, estimate=True), "v": Initial(0.0, estimate=True)},
)


def ball(name: str, what: str, file: str, sums: tuple[str, str]) -> Case:
    """The case of one ball, from the sums of its two files."""
    files = source(file, sums)

    def measured(folder: Path | None) -> Record:
        return drops(files, folder).runs[0]

    def held_out(folder: Path | None) -> Mapping[str, Held]:
        return {"drop 2": Held(drops(files, folder).runs[1])}

    sentence = f"A drop of {what} against free fall; the air's drag is missing."
    tags = ("measured", "mechanical")
    return Case(name, sentence, FREE_FALL, measured=measured, noises=(0.0,), held_out=held_out, tags=tags)
