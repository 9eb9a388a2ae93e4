"""A quarter car on a rig that drives the wheel hub; its model lacks the bump stop."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="sprung mass over a driven hub",
    states={"s": "v", "v": "-(k*s + c*v)/m - hub"},
    parameters={
        "m": Parameter(300.0, fixed=True, unit="kg"),
        "k": Parameter(16000.0, sd=800.0, unit="N/m"),
        "c": Parameter(1000.0, sd=100.0, unit="N s/m"),
    },
    inputs={"hub": Input("hub_acceleration")},
    outputs={"travel": Output("s", column="travel")},
    initial={"s": Initial(0.0), "v": Initial(0.0)},
)
PLANT = DEFICIENT.plus("v", "-a*max(s - w, 0)", {"a": Parameter(200.0), "w": Parameter(0.04)})

CASE = Case(
    name="quarter-car-bump-stop",
    sentence="A quarter car, its travel s and the hub's acceleration measured; the bump stop at 40 mm is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(10.0, 0.02, (0.0, 0.0), {"hub": multisine(2.0, 0.5, 3.0, 10)}),
    missing=(Missing("hard_stop", "v", {"a": 200.0}),),
    tags=("mechanical", "vehicle"),
)
