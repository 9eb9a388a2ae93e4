"""An oscillator near a machine whose tone its model lacks."""

from cases.duffing import DEFICIENT
from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Parameter

TONE = {"a": Parameter(0.3), "b": Parameter(0.2), "w": Parameter(1.9, unit="rad/s")}

CASE = Case(
    name="oscillator-tone",
    sentence="A driven oscillator, its position measured; the tone of a machine nearby is missing.",
    deficient=DEFICIENT,
    truth=DEFICIENT.plus("v", "+a*cos(w*t) + b*sin(w*t)", TONE),
    experiment=Experiment(60.0, 0.1, (0.0, 0.0), {"F": multisine(0.5, 0.05, 0.4, 12)}),
    missing=(Missing("harmonic_forcing", "v", {"a": 0.3, "b": 0.2}),),
    tags=("mechanical",),
)
