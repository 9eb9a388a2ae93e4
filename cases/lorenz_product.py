"""Lorenz-63 whose model lacks the product x z in the second equation."""

from cases.lorenz_hidden_cubic import DEFICIENT as LORENZ
from suite.case import Case, Experiment, Missing
from suite.model import Model, Parameter

DEFICIENT = Model(
    name="Lorenz-63 without x z",
    states={**LORENZ.states, "y": "rho*x - y"},
    parameters=LORENZ.parameters,
    outputs=LORENZ.outputs,
    initial=LORENZ.initial,
)
PLANT = DEFICIENT.plus("y", "+a*x*z", {"a": Parameter(-1.0)})

CASE = Case(
    name="lorenz-product",
    sentence="Three seconds of Lorenz-63: x z is missing in the second equation, so the model alone runs away.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(3.0, 0.01, (-8.0, 8.0, 27.0)),
    missing=(Missing("product_coupling", "y", {"a": -1.0}),),
    tags=("chaotic", "outside"),
)
