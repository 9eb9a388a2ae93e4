"""A pendulum with dry friction and drag, which together look like oil: each alone fits worse than viscous damping."""

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Output, Parameter

DEFICIENT = Model(
    name="pendulum with viscous damping",
    states={"th": "w", "w": "-g/L*sin(th) - c*w"},
    parameters={
        "g": Parameter(9.81, fixed=True, unit="m/s^2"),
        "L": Parameter(1.0, sd=0.01, unit="m"),
        "c": Parameter(0.005, sd=0.2, unit="1/s"),
    },
    outputs={"angle": Output("th", column="angle")},
    initial={"th": Initial(2.0, estimate=True), "w": Initial(0.0)},
)
DRY, DRAG = 0.12, 0.06
PLANT = DEFICIENT.plus("w", "-a*tanh(w/s)", {"a": Parameter(DRY), "s": Parameter(0.02, fixed=True)}).plus(
    "w", "-b*w*abs(w)", {"b": Parameter(DRAG)}
)

CASE = Case(
    name="pendulum-friction-and-drag",
    sentence="A pendulum released at 115 degrees: dry friction and quadratic drag are both missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(30.0, 0.05, (2.0, 0.0)),
    missing=(Missing("coulomb_friction", "w", {"a": DRY}), Missing("quadratic_drag", "w", {"b": DRAG})),
    tags=("mechanical", "fluid", "pair"),
)
