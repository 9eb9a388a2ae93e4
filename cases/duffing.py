"""A driven mass on a hardening spring whose model has a straight one; only the position is measured."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="driven oscillator",
    states={"p": "v", "v": "(F - c*v - k*p)/m"},
    parameters={
        "m": Parameter(1.0, fixed=True, unit="kg"),
        "c": Parameter(0.3, sd=0.03, unit="N s/m"),
        "k": Parameter(1.0, sd=0.05, unit="N/m"),
    },
    inputs={"F": Input("force")},
    outputs={"pos": Output("p", column="pos")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
PLANT = DEFICIENT.plus("v", "-a*p**3", {"a": Parameter(0.3)})
EXPERIMENT = Experiment(60.0, 0.1, (0.0, 0.0), {"F": multisine(1.0, 0.05, 0.4, 12)})

CASE = Case(
    name="duffing",
    sentence="A mass on a spring shaken by twelve tones; the spring's cubic hardening is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(Missing("cubic_stiffness", "v", {"a": 0.3}),),
    tags=("mechanical",),
)
