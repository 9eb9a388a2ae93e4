"""A Van der Pol oscillator with a small hidden cubic force."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="Van der Pol oscillator",
    states={"x": "v", "v": "mu*(1 - x**2)*v - x"},
    parameters={"mu": Parameter(0.5, sd=0.025)},
    outputs={"x": Output("x", column="x"), "v": Output("v", column="v")},
    initial={"x": Initial(2.0, estimate=True), "v": Initial(0.0, estimate=True)},
)
PLANT = DEFICIENT.plus("v", "-a*x**3", {"a": Parameter(-0.01)})
EXPERIMENT = Experiment(50.0, 0.01, (2.0, 0.0))

CASE = Case(
    name="van-der-pol-hidden-cubic",
    sentence="Ebers, Steele and Kutz (2022), Van der Pol with mu = 0.5: 0.01 x^3 is hidden in the velocity's equation.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(Missing("cubic_stiffness", "v", {"a": -0.01}),),
    # Standard deviations of 0 (here: of rounding), 0.001, 0.01 and 0.1 on states whose own are 1.4.
    noises=(1e-6, 7e-4, 7e-3, 7e-2),
    tags=("mechanical", "published"),
)
