"""A capsule falls into the air, tracked by radar; nothing is missing, but its ballistic coefficient is wrong."""

from suite.case import Case, Experiment
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="re-entry",
    states={"h": "-v", "v": "g - rho0*exp(-h/H)*v**2/(2*B)"},
    parameters={
        "g": Parameter(9.81, fixed=True, unit="m/s^2"),
        "rho0": Parameter(1.22, fixed=True, unit="kg/m^3"),
        "H": Parameter(7200.0, fixed=True, unit="m"),
        "B": Parameter(900.0, sd=300.0, unit="kg/m^2"),
    },
    outputs={"h": Output("h", column="height")},
    initial={"h": Initial(60000.0, estimate=True), "v": Initial(5000.0, estimate=True)},
)

CASE = Case(
    name="reentry",
    sentence="A capsule falls from 60 to 2 km, tracked by radar: nothing is missing, its ballistic coefficient is off.",
    deficient=DEFICIENT,
    truth=DEFICIENT.with_values({"B": 1200.0}),
    experiment=Experiment(20.0, 0.1, (60000.0, 5000.0)),
    tags=("aircraft", "fluid", "null", "wrong-parameter"),
)
