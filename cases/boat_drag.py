"""A boat under a measured thrust; its model has viscous drag alone."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="boat with viscous drag",
    states={"p": "v", "v": "(T - c*v)/m"},
    parameters={
        "m": Parameter(200.0, fixed=True, unit="kg"),
        "c": Parameter(20.0, sd=4.0, unit="N s/m"),
    },
    inputs={"T": Input("thrust")},
    outputs={"v": Output("v", column="speed")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
PLANT = DEFICIENT.plus("v", "-a*v*abs(v)", {"a": Parameter(0.1)})

CASE = Case(
    name="boat-drag",
    sentence="A boat under thrust steps, forward and back, its speed measured by a log; quadratic drag is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(150.0, 0.5, (0.0, 0.0), {"T": steps(150.0, 12.0)}),
    missing=(Missing("quadratic_drag", "v", {"a": 0.1}),),
    tags=("mechanical", "fluid", "vehicle"),
)
