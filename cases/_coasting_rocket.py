"""What the cases of rockets share: the coast from two seconds after burnout to apogee, its last 40 % predicted."""

from collections.abc import Mapping
from pathlib import Path

from suite.case import Case, Held
from suite.measured import Source, run
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record

FITTED = 0.6  # of the coast


def rocket(
    name: str, what: str, file: str, sha256: str, upstream: str, columns: tuple[str, str], coast: tuple[float, float]
) -> Case:
    """The case of one flight: the columns of time and height, the first and last second of the coast."""
    origin = f"github.com/RocketPy-Team/RocketPy, data/rockets/{upstream}, as {file}"
    files = Source("rockets", origin, {file: sha256})

    def flight(folder: Path | None) -> Record:
        t, h = files.columns(folder, file, columns).values()
        rows = (t >= coast[0]) & (t <= coast[1])
        return run(f"coast of {what}", t[rows], [], [h[rows]])

    def measured(folder: Path | None) -> Record:
        whole = flight(folder)
        return whole.part(0, int(FITTED * len(whole)))

    def held_out(folder: Path | None) -> Mapping[str, Held]:
        whole = flight(folder)
        seen = int(FITTED * len(whole))
        return {"last 40 %": Held(whole, lead=seen, first=seen)}

    model = Model(
        name="ballistic flight",
        states={"h": "v", "v": "-g"},
        parameters={"g": Parameter(9.81, fixed=True, unit="m/s^2")},
        outputs={"h": Output("h", column="height")},
        initial={"h": Initial(1000.0, estimate=True), "v": Initial(300.0, estimate=True)},
    )
    sentence = f"The rocket {what} coasts to its apogee against ballistic flight; the air's drag is missing."
    tags = ("measured", "mechanical")
    return Case(name, sentence, model, measured=measured, noises=(0.0,), held_out=held_out, tags=tags)
