"""Lorenz-63 with nothing missing."""

from cases.lorenz_hidden_cubic import DEFICIENT
from suite.case import Case, Experiment

CASE = Case(
    name="null-lorenz",
    sentence="Lorenz-63 and a model that lacks nothing; all three states are measured.",
    deficient=DEFICIENT,
    truth=DEFICIENT,
    experiment=Experiment(10.0, 0.02, (-8.0, 8.0, 27.0)),
    tags=("chaotic", "null"),
)
