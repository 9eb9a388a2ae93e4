"""The short-period motion of an aircraft whose model has a linear lift curve."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="short period, linear lift",
    states={"alpha": "q - Z*alpha - Zd*de", "q": "-M*alpha - Mq*q - Md*de"},
    parameters={
        "Z": Parameter(0.9, sd=0.045, unit="1/s"),
        "Zd": Parameter(0.1, sd=0.02, unit="1/s"),
        "M": Parameter(5.0, sd=0.25, unit="1/s^2"),
        "Mq": Parameter(1.2, sd=0.06, unit="1/s"),
        "Md": Parameter(8.0, sd=0.4, unit="1/s^2"),
    },
    inputs={"de": Input("elevator")},
    outputs={"alpha": Output("alpha", column="alpha"), "q": Output("q", column="q")},
    initial={"alpha": Initial(0.0), "q": Initial(0.0)},
    suspect=("alpha", "q"),
)
PLANT = DEFICIENT.plus("alpha", "-a*alpha**3", {"a": Parameter(6.0)})

CASE = Case(
    name="aircraft-short-period",
    sentence="An aircraft through elevator steps, incidence and pitch rate measured; the cubic lift is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(20.0, 0.05, (0.0, 0.0), {"de": steps(0.12, 1.5, (1.0, -1.0, 0.0, -2.0, 2.0, -1.5, 0.5))}),
    missing=(Missing("cubic_term", "alpha", {"a": 6.0}),),
    tags=("aircraft",),
)
