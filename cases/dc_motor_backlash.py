"""A motor turns a sprung load through gears with play; its model has no load at all."""

from dataclasses import replace

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="motor",
    states={"p": "v", "v": "(K*i - c*v)/J"},
    parameters={
        "J": Parameter(0.02, fixed=True, unit="kg m^2"),
        "K": Parameter(0.1, sd=0.005, unit="N m/A"),
        "c": Parameter(0.05, sd=0.005, unit="N m s"),
    },
    inputs={"i": Input("current")},
    outputs={"angle": Output("p", column="angle")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
# z is dragged along by p where they are the play w apart.
FORTH = "0.5*max(v, 0)*(1 + tanh(20*((p - z)/w - 1)))"
BACK = "0.5*min(v, 0)*(1 + tanh(20*((z - p)/w - 1)))"
PLANT = replace(
    DEFICIENT,
    states={"p": "v", "v": "(K*i - c*v)/J - a*z", "z": f"{FORTH} + {BACK}"},
    parameters={**DEFICIENT.parameters, "a": Parameter(6.0), "w": Parameter(0.15)},
)

CASE = Case(
    name="dc-motor-backlash",
    sentence="A motor with a measured current and angle; a sprung load behind gears with play is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(20.0, 0.04, (0.0, 0.0, 0.0), {"i": multisine(0.5, 0.1, 0.8, 8)}),
    missing=(Missing("backlash", "v", {"a": 6.0}),),
    tags=("mechanical", "electrical"),
)
