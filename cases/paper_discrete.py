"""The cubic plant as the discrete-time methods see it: its model error is constant over each sample."""

from cases.paper_cubic import DEFICIENT, EXPERIMENT, PLANT
from suite.case import Case, Missing

CASE = Case(
    name="paper-cubic-discrete",
    sentence="Raol and others (2016), the sampled plant: x2^3 is missing and held over each sample.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=EXPERIMENT,
    missing=(Missing("cubic_stiffness", "x1", {"a3": 0.0195}),),
    held=True,
    tags=("mechanical", "published"),
)
