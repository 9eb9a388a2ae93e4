"""A driven mass on a mount with hysteresis that its model lacks."""

from dataclasses import replace

from cases.duffing import DEFICIENT
from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Parameter

PLANT = replace(
    DEFICIENT,
    states={"p": "v", "v": "(F - c*v - k*p)/m - a*z", "z": "v - (abs(v)*z + v*abs(z))/(2*w)"},
    parameters={**DEFICIENT.parameters, "a": Parameter(0.8), "w": Parameter(0.4)},
)

CASE = Case(
    name="bouc-wen",
    sentence="A mass on a mount shaken by twelve tones, its position measured; Bouc-Wen hysteresis is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(60.0, 0.1, (0.0, 0.0, 0.0), {"F": multisine(1.0, 0.05, 0.4, 12)}),
    missing=(Missing("bouc_wen_hysteresis", "v", {"a": 0.8}),),
    tags=("mechanical",),
)
