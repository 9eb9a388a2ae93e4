"""A robot joint whose friction falls before it rises; its model has viscous friction alone."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="joint with viscous friction",
    states={"q": "v", "v": "(u - c*v - k*q)/J"},
    parameters={
        "J": Parameter(0.05, fixed=True, unit="kg m^2"),
        "c": Parameter(0.04, sd=0.004, unit="N m s"),
        "k": Parameter(0.2, sd=0.02, unit="N m"),
    },
    inputs={"u": Input("torque")},
    outputs={"angle": Output("q", column="angle")},
    initial={"q": Initial(0.0), "v": Initial(0.0)},
)
INNER = {"s": Parameter(0.3, fixed=True), "w": Parameter(0.02, fixed=True)}
TERM = "-(a + b*exp(-(v/s)**2))*tanh(v/w)"
PLANT = DEFICIENT.plus("v", TERM, {"a": Parameter(0.8), "b": Parameter(0.8), **INNER})

CASE = Case(
    name="stribeck-joint",
    sentence="A joint driven by eight tones, read by an encoder; Stribeck friction is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(20.0, 0.04, (0.0, 0.0), {"u": multisine(0.12, 0.1, 1.0, 8)}),
    missing=(Missing("stribeck_friction", "v", {"a": 0.8, "b": 0.8}),),
    tags=("mechanical", "robot"),
)
