"""An epidemic among people whose immunity wanes; the model has it last for ever."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="susceptible, infected, recovered",
    states={"S": "-b*S*I", "I": "b*S*I - g*I", "R": "g*I"},
    parameters={"b": Parameter(0.4, sd=0.02, unit="1/day"), "g": Parameter(0.15, sd=0.0075, unit="1/day")},
    outputs={"I": Output("I", column="infected"), "R": Output("R", column="immune")},
    initial={"S": Initial(0.99, estimate=True), "I": Initial(0.01, estimate=True), "R": Initial(0.0)},
)
WANING = {"a": Parameter(0.012, unit="1/day")}
PLANT = DEFICIENT.plus("S", "+a*R", WANING).plus("R", "-a*R", WANING)

CASE = Case(
    name="epidemic-waning",
    sentence="An epidemic over 300 days, infected daily and the immune weekly; waning immunity is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(300.0, 1.0, (0.99, 0.01, 0.0), every={"R": 7}),
    missing=(Missing("transfer", "S", {"a": 0.012}),),
    tags=("population",),
)
