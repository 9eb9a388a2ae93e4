"""A light ball falls from a tower; its model is free fall."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="free fall",
    states={"z": "v", "v": "-g"},
    parameters={"g": Parameter(9.81, fixed=True, unit="m/s^2")},
    outputs={"z": Output("z", column="height")},
    initial={"z": Initial(45.0, estimate=True), "v": Initial(0.0, estimate=True)},
)
PLANT = DEFICIENT.plus("v", "-a*v*abs(v)", {"a": Parameter(0.03)})

CASE = Case(
    name="falling-ball",
    sentence="A light ball falls 45 m, filmed at 60 pictures a second; the air's drag is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(3.6, 1 / 60, (45.0, 0.0)),
    missing=(Missing("quadratic_drag", "v", {"a": 0.03}),),
    tags=("mechanical", "fluid"),
)
