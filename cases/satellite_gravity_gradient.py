"""A satellite pitches under its wheel's torque; its model lacks the gravity gradient."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="rigid satellite",
    states={"th": "w", "w": "u/I"},
    parameters={"I": Parameter(120.0, sd=6.0, unit="kg m^2")},
    inputs={"u": Input("torque")},
    outputs={"th": Output("th", column="pitch")},
    initial={"th": Initial(0.9, estimate=True), "w": Initial(0.0, estimate=True)},
)
# 3/2 n^2 (Ix - Iz)/Iy of a low orbit, n = 1.1e-3 rad/s.
PLANT = DEFICIENT.plus("w", "-a*sin(2*th)", {"a": Parameter(1.4e-6)})

CASE = Case(
    name="satellite-gravity-gradient",
    sentence="A satellite's pitch over two orbits, by star tracker; the gravity gradient, a sin(2 th), is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(12000.0, 30.0, (0.9, 0.0), {"u": multisine(5e-6, 1e-4, 8e-4, 8)}),
    missing=(Missing("gravity_gradient", "w", {"a": 1.4e-6}),),
    tags=("aircraft", "mechanical", "outside"),
)
