"""Forty cells of Lorenz-96, every other one measured; one cell has a cubic loss that the model lacks."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

N = 40
DEFICIENT = Model(
    name="Lorenz-96",
    states={f"x{i}": f"(x{(i + 1) % N} - x{(i - 2) % N})*x{(i - 1) % N} - x{i} + F" for i in range(N)},
    parameters={"F": Parameter(8.0, sd=0.4)},
    outputs={f"y{i}": Output(f"x{i}", column=f"x{i}") for i in range(0, N, 2)},
    initial={f"x{i}": Initial(8.0 + (i == 19), estimate=True) for i in range(N)},
)
PLANT = DEFICIENT.plus("x0", "-a*x0**3", {"a": Parameter(0.05)})

CASE = Case(
    name="lorenz-96",
    sentence="Lorenz (1996) with forty cells and F = 8: a cubic loss in one cell is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(10.0, 0.05, tuple(8.0 + (i == 19) for i in range(N))),
    missing=(Missing("cubic_term", "x0", {"a": 0.05}),),
    tags=("chaotic", "chain", "large"),
)
