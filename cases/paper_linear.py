"""The same plant with its damping, its spring and its cubic spring all missing from the model."""

from cases.paper_cubic import EXPERIMENT, PLANT
from suite.case import Case, Missing
from suite.model import Initial, Model, Output

CASE = Case(
    name="paper-terms",
    sentence="Raol and others (2016), case ii: x1, x2 and x2^3 are all missing, both states are measured.",
    deficient=Model(
        name="driven plant without its damping and springs",
        states={"x1": "2.5*cos(t)", "x2": "x1"},
        outputs={"x1": Output("x1", column="x1"), "x2": Output("x2", column="x2")},
        initial={"x1": Initial(0.0), "x2": Initial(0.0)},
    ),
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(
        Missing("viscous_damping", "x1", {"a1": 0.68}),
        Missing("linear_stiffness", "x1", {"a2": 1.0}),
        Missing("cubic_stiffness", "x1", {"a3": 0.0195}),
    ),
    tags=("mechanical", "published"),
)
