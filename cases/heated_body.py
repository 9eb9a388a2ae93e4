"""A heated body cools to the air; its model lacks radiation."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="heated body, convection alone",
    states={"T": "(P - h*(T - Ta))/C"},
    parameters={
        "C": Parameter(500.0, fixed=True, unit="J/K"),
        "h": Parameter(0.5, sd=0.05, unit="W/K"),
        "Ta": Parameter(293.0, fixed=True, unit="K"),
    },
    inputs={"P": Input("power")},
    outputs={"T": Output("T", column="temperature")},
    initial={"T": Initial(293.0, estimate=True)},
)
# Emissivity 0.9, 0.05 m^2, over C, in 1e-8/(K^3 s).
PLANT = DEFICIENT.plus("T", "-a*(T**4 - Ta**4)*1e-8", {"a": Parameter(5.1e-4)})

CASE = Case(
    name="heated-body",
    sentence="A body under steps of heating power, between 293 and 650 K; radiation is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(9000.0, 20.0, (293.0,), {"P": steps(200.0, 1200.0, (1.0, 0.2, 2.0, 0.0))}),
    missing=(Missing("radiation", "T", {"a": 5.1e-4}),),
    tags=("thermal",),
)
