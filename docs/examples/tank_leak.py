"""A tank that is filled and leaks; its model has no leak."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="tank without a leak",
    states={"h": "q/A"},
    parameters={"A": Parameter(2.0, fixed=True)},
    inputs={"q": Input("q")},
    outputs={"h": Output("h", column="h")},
    initial={"h": Initial(1.0)},
)

CASE = Case(
    name="tank-leak",
    sentence="A tank is filled in steps; its leak, by the root of the level, is missing.",
    deficient=DEFICIENT,
    truth=DEFICIENT.plus("h", "-a*sqrt(abs(h))", {"a": Parameter(0.2)}),
    experiment=Experiment(20.0, 0.1, (1.0,), {"q": steps(0.5, 4.0, (1.0, 0.5, 2.0))}),
    missing=(Missing("outflow", "h", {"a": 0.2}),),
)
