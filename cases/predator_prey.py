"""Predators and prey; the model lacks the crowding of the prey."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="Lotka and Volterra",
    states={"x": "r*x - b*x*y", "y": "e*x*y - m*y"},
    parameters={
        "r": Parameter(0.6, sd=0.03, unit="1/year"),
        "b": Parameter(0.03, sd=0.0015),
        "e": Parameter(0.02, sd=0.001),
        "m": Parameter(0.8, sd=0.04, unit="1/year"),
    },
    outputs={"x": Output("x", column="prey"), "y": Output("y", column="predators")},
    initial={"x": Initial(30.0, estimate=True), "y": Initial(5.0, estimate=True)},
)
PLANT = DEFICIENT.plus("x", "-a*x**2", {"a": Parameter(0.001)})

CASE = Case(
    name="predator-prey",
    sentence="Fifty years of predators and prey, both counted each season; the crowding of the prey is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(50.0, 0.25, (30.0, 5.0)),
    missing=(Missing("self_limitation", "x", {"a": 0.001}),),
    tags=("population",),
)
