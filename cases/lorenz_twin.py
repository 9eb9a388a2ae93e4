"""The Lorenz-63 twin of data assimilation: a perfect model, seldom observed."""

from cases.lorenz_hidden_cubic import DEFICIENT as LORENZ
from suite.case import Case, Experiment
from suite.model import Initial, Model, Parameter

FIRST = (1.509, -1.531, 25.46)
DEFICIENT = Model(
    name="Lorenz-63",
    states=LORENZ.states,
    parameters={name: Parameter(entry.value, fixed=True) for name, entry in LORENZ.parameters.items()},
    outputs=LORENZ.outputs,
    initial={name: Initial(value, estimate=True) for name, value in zip("xyz", FIRST, strict=True)},
)

CASE = Case(
    name="lorenz-twin",
    sentence="Sakov, Oliver and Bertino (2012) as DAPPER sets it up: Lorenz-63, perfect model, a sample seen in 25.",
    deficient=DEFICIENT,
    truth=DEFICIENT,
    experiment=Experiment(50.0, 0.01, FIRST, every={"x": 25, "y": 25, "z": 25}),
    # R = 2 I: a standard deviation of 1.41, which is 0.166 of the states' own 7.9, 9.0 and 8.6 (0.157 to 0.179).
    noises=(0.166,),
    tags=("chaotic", "null", "published"),
)
