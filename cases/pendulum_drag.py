"""A pendulum swings out from a large angle; its model lacks the air's drag."""

from cases.pendulum_dry_friction import DEFICIENT as PENDULUM
from suite.case import Case, Experiment, Missing
from suite.model import Initial, Model, Parameter

DEFICIENT = Model(
    name=PENDULUM.name,
    states=PENDULUM.states,
    parameters=PENDULUM.parameters,
    outputs=PENDULUM.outputs,
    initial={"th": Initial(2.5, estimate=True), "w": Initial(0.0)},
)
PLANT = DEFICIENT.plus("w", "-a*w*abs(w)", {"a": Parameter(0.08)})

CASE = Case(
    name="pendulum-drag",
    sentence="A pendulum released at 143 degrees, read by an encoder; quadratic drag is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(20.0, 0.05, (2.5, 0.0)),
    missing=(Missing("quadratic_drag", "w", {"a": 0.08}),),
    tags=("mechanical", "fluid"),
)
