"""A hundred masses in a row between a wall and a shaker; the wall's spring hardens."""

from cases.chain_small import chain
from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Parameter

DEFICIENT = chain(100, (2, 25, 50, 75, 100))

CASE = Case(
    name="chain-of-masses",
    sentence="A hundred masses in a row, shaken at one end, five measured; the wall spring's hardening is missing.",
    deficient=DEFICIENT,
    truth=DEFICIENT.plus("v1", "-a*x1**3", {"a": Parameter(8.0)}),
    experiment=Experiment(100.0, 0.1, (0.0,) * 200, {"F": multisine(6.0, 0.01, 0.4, 24)}),
    missing=(Missing("cubic_stiffness", "v1", {"a": 8.0}),),
    noises=(0.01, 0.05),
    tags=("mechanical", "chain", "large"),
)
