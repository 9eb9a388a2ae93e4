"""A slider on springs, driven at random; its model lacks the dry friction of its guide."""

from cases.duffing import DEFICIENT
from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Parameter

PLANT = DEFICIENT.plus("v", "-a*tanh(v/s)", {"a": Parameter(0.3), "s": Parameter(0.01, fixed=True)})

CASE = Case(
    name="slider-friction",
    sentence="A slider driven by a random-phase multisine, its position measured; dry friction is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(50.0, 0.1, (0.0, 0.0), {"F": multisine(0.8, 0.04, 0.5, 16, seed=4)}),
    missing=(Missing("coulomb_friction", "v", {"a": 0.3}),),
    tags=("mechanical",),
)
