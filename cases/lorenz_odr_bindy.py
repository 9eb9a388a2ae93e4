"""Lorenz-63 without its product x z, at noise up to 30 %."""

from cases.lorenz_product import DEFICIENT, PLANT
from suite.case import Case, Experiment, Missing

CASE = Case(
    name="lorenz-odr-bindy",
    sentence="The setting of ODR-BINDy in discrepancy form, Lorenz-63 over 10 s at noise up to 30 %: x z is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(10.0, 0.01, (-8.0, 8.0, 27.0)),
    missing=(Missing("product_coupling", "y", {"a": -1.0}),),
    noises=(0.01, 0.1, 0.2, 0.3),
    tags=("chaotic", "published"),
)
