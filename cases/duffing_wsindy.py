"""The Duffing oscillator of the weak-form sparse regression, without its cubic spring."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="damped oscillator",
    states={"x": "y", "y": "-mu*y - alpha*x"},
    parameters={"mu": Parameter(0.2, sd=0.01), "alpha": Parameter(0.05, sd=0.0025)},
    outputs={"x": Output("x", column="x"), "y": Output("y", column="y")},
    initial={"x": Initial(0.0, estimate=True), "y": Initial(2.0, estimate=True)},
)
PLANT = DEFICIENT.plus("y", "-beta*x**3", {"beta": Parameter(1.0)})
EXPERIMENT = Experiment(30.0, 0.01, (0.0, 2.0))

CASE = Case(
    name="duffing-wsindy",
    sentence="Messenger and Bortz (2021), Duffing in free decay: beta x^3 is missing, both states are measured.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(Missing("cubic_stiffness", "y", {"beta": 1.0}),),
    noises=(0.01, 0.1, 0.2, 0.4),
    tags=("mechanical", "published"),
)
