"""A boat under a measured thrust in a steady wind; its model has viscous drag alone."""

from cases.boat_drag import DEFICIENT, PLANT
from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Parameter

CASE = Case(
    name="boat-drag-and-wind",
    sentence="A boat under thrust steps, its speed measured by a log; quadratic drag and a steady wind are missing.",
    deficient=DEFICIENT,
    truth=PLANT.plus("v", "+b", {"b": Parameter(0.03)}),
    experiment=Experiment(150.0, 0.5, (0.0, 0.0), {"T": steps(150.0, 12.0)}),
    missing=(Missing("quadratic_drag", "v", {"a": 0.1}), Missing("constant_force", "v", {"b": 0.03})),
    tags=("mechanical", "fluid", "vehicle", "pair"),
)
