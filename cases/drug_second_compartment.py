"""A drug in the blood; the model has one compartment, the body two."""

from dataclasses import replace

from suite.case import Case, Experiment, Missing
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="one compartment",
    states={"c": "D/V - k*c"},
    parameters={
        "V": Parameter(12.0, sd=0.6, unit="l"),
        "k": Parameter(0.35, sd=0.035, unit="1/h"),
    },
    inputs={"D": Input("infusion")},
    outputs={"c": Output("c", column="concentration")},
    initial={"c": Initial(0.0)},
)
PLANT = replace(
    DEFICIENT,
    states={"c": "D/V - k*c - a*(c - z)", "z": "w*(c - z)"},
    parameters={**DEFICIENT.parameters, "a": Parameter(0.6, unit="1/h"), "w": Parameter(0.25, unit="1/h")},
)

CASE = Case(
    name="drug-second-compartment",
    sentence="Two infusions of a drug and 40 hours of blood samples; the tissue it passes into is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(40.0, 0.2, (0.0, 0.0), {"D": lambda t: 60.0 if t < 2 or 15 <= t < 16 else 0.0}),
    missing=(Missing("second_compartment", "c", {"a": 0.6}),),
    tags=("population", "chemical"),
)
