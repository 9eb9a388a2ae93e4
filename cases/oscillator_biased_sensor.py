"""A driven oscillator complete in its equations, whose sensor reads too much."""

from cases.duffing import DEFICIENT
from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Parameter

CASE = Case(
    name="oscillator-biased-sensor",
    sentence="A driven oscillator whose equations lack nothing; its position sensor has a bias.",
    deficient=DEFICIENT,
    truth=DEFICIENT.plus("pos", "+a", {"a": Parameter(0.3)}),
    experiment=Experiment(60.0, 0.1, (0.0, 0.0), {"F": multisine(1.0, 0.05, 0.4, 12)}),
    missing=(Missing("sensor_bias", "pos", {"a": 0.3}),),
    tags=("mechanical", "sensor"),
)
