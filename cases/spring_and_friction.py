"""A carriage on a hardening spring, its bearing rubbing dry; its model has neither."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="carriage on a linear spring",
    states={"p": "v", "v": "(F - c*v - k*p)/m"},
    parameters={
        "m": Parameter(1.0, fixed=True, unit="kg"),
        "c": Parameter(0.3, sd=0.03, unit="N s/m"),
        "k": Parameter(4.0, sd=0.2, unit="N/m"),
    },
    inputs={"F": Input("force")},
    outputs={"pos": Output("p", column="pos")},
    initial={"p": Initial(0.0), "v": Initial(0.0)},
)
PLANT = DEFICIENT.plus("v", "-a*p**3", {"a": Parameter(1.5)}).plus("v", "-b*tanh(v/0.005)", {"b": Parameter(0.4)})

CASE = Case(
    name="spring-and-friction",
    sentence="A carriage under a broad force, its position measured; a cubic spring and dry friction are both missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(40.0, 0.05, (0.0, 0.0), {"F": multisine(2.0, 0.05, 0.8, 12)}),
    missing=(Missing("cubic_stiffness", "v", {"a": 1.5}), Missing("coulomb_friction", "v", {"b": 0.4})),
    tags=("mechanical", "pair"),
)
