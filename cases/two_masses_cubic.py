"""Two coupled masses, driven and measured at the far one; the near one's wall spring hardens."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="two masses",
    states={
        "x1": "v1",
        "v1": "(-k1*x1 - c*v1 - k2*(x1 - x2))/m",
        "x2": "v2",
        "v2": "(F - c*v2 - k2*(x2 - x1))/m",
    },
    parameters={
        "m": Parameter(1.0, fixed=True, unit="kg"),
        "c": Parameter(0.2, sd=0.02, unit="N s/m"),
        "k1": Parameter(2.0, sd=0.1, unit="N/m"),
        "k2": Parameter(4.0, sd=0.2, unit="N/m"),
    },
    inputs={"F": Input("force")},
    outputs={"x2": Output("x2", column="x2")},
    initial={name: Initial(0.0) for name in ("x1", "v1", "x2", "v2")},
)
PLANT = DEFICIENT.plus("v1", "-a*x1**3", {"a": Parameter(0.8)})

CASE = Case(
    name="two-masses-cubic",
    sentence="Two masses of which only the far one is measured; the cubic part of the wall spring is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(50.0, 0.1, (0.0,) * 4, {"F": multisine(1.0, 0.05, 0.6, 12)}),
    missing=(Missing("cubic_stiffness", "v1", {"a": 0.8}),),
    tags=("mechanical",),
)
