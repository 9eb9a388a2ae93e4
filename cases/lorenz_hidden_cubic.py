"""Lorenz-63 with a small hidden cubic term."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="Lorenz-63",
    states={"x": "sigma*(y - x)", "y": "x*(rho - z) - y", "z": "x*y - beta*z"},
    parameters={
        "sigma": Parameter(10.0, sd=0.5),
        "rho": Parameter(28.0, sd=1.4),
        "beta": Parameter(8 / 3, sd=0.13),
    },
    outputs={name: Output(name, column=name) for name in "xyz"},
    initial={
        "x": Initial(-8.0, estimate=True),
        "y": Initial(8.0, estimate=True),
        "z": Initial(27.0, estimate=True),
    },
)
PLANT = DEFICIENT.plus("x", "-a*x**3", {"a": Parameter(-0.01)})

CASE = Case(
    name="lorenz-hidden-cubic",
    sentence="Ebers, Steele and Kutz (2022), Lorenz-63: 0.01 x^3 is hidden in the first equation.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(50.0, 0.01, (-8.0, 8.0, 27.0)),
    missing=(Missing("cubic_term", "x", {"a": -0.01}),),
    # Standard deviations of 0 (here: of rounding), 0.001, 0.01 and 0.1 on states whose own are 8.5 to 9.
    noises=(1e-6, 1.1e-4, 1.1e-3, 1.1e-2),
    tags=("chaotic", "published"),
)
