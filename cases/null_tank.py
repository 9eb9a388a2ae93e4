"""Two tanks with nothing missing."""

from cases.tank_second_outlet import DEFICIENT
from suite.case import Case, Experiment
from suite.excitation import steps

CASE = Case(
    name="null-tank",
    sentence="Two tanks under inflow steps and a model that lacks nothing; both levels are measured.",
    deficient=DEFICIENT,
    truth=DEFICIENT,
    experiment=Experiment(1500.0, 5.0, (0.2, 0.1), {"Q": lambda t: 2.5e-4 + steps(1e-4, 120.0)(t)}),
    tags=("fluid", "null"),
)
