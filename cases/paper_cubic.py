"""The example of the generalized model-error estimators: a driven plant with a cubic spring that the model lacks."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="driven plant without its cubic spring",
    states={"x1": "2.5*cos(t) - a1*x1 - a2*x2", "x2": "x1"},
    parameters={"a1": Parameter(0.68), "a2": Parameter(1.0)},
    outputs={"x1": Output("x1", column="x1"), "x2": Output("x2", column="x2")},
    initial={"x1": Initial(0.0), "x2": Initial(0.0)},
)
PLANT = DEFICIENT.plus("x1", "-a3*x2**3", {"a3": Parameter(0.0195)})
EXPERIMENT = Experiment(duration=14.0, dt=0.05, x0=(0.0, 0.0))

CASE = Case(
    name="paper-cubic",
    sentence="Raol and others (2016), equations (100)-(101): x2^3 is missing, both states are measured.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(Missing("cubic_stiffness", "x1", {"a3": 0.0195}),),
    tags=("mechanical", "published"),
)
