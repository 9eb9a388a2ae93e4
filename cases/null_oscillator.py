"""A driven oscillator with nothing missing."""

from cases.duffing import DEFICIENT
from suite.case import Case, Experiment
from suite.excitation import multisine

CASE = Case(
    name="null-oscillator",
    sentence="A driven oscillator and a model that lacks nothing; its position is measured.",
    deficient=DEFICIENT,
    truth=DEFICIENT,
    experiment=Experiment(60.0, 0.1, (0.0, 0.0), {"F": multisine(1.0, 0.05, 0.4, 12)}),
    tags=("mechanical", "null"),
)
