"""A pendulum swings out; its model knows the bearing's oil but not its dry friction."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="pendulum with viscous damping",
    states={"th": "w", "w": "-g/L*sin(th) - c*w"},
    parameters={
        "g": Parameter(9.81, fixed=True, unit="m/s^2"),
        "L": Parameter(1.0, sd=0.01, unit="m"),
        "c": Parameter(0.05, sd=0.01, unit="1/s"),
    },
    outputs={"angle": Output("th", column="angle")},
    initial={"th": Initial(1.2, estimate=True), "w": Initial(0.0)},
)
PLANT = DEFICIENT.plus("w", "-a*tanh(w/s)", {"a": Parameter(0.12), "s": Parameter(0.02, fixed=True)})

CASE = Case(
    name="pendulum-dry-friction",
    sentence="A pendulum released at 69 degrees, read by an encoder; dry friction is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(20.0, 0.05, (1.2, 0.0)),
    missing=(Missing("coulomb_friction", "w", {"a": 0.12}),),
    tags=("mechanical",),
)
