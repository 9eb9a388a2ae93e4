"""A driven oscillator whose actuator lags behind its command."""

from dataclasses import replace

from cases.duffing import DEFICIENT
from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Parameter

# The force is z, which follows the commanded F with a time constant.
STATES = {"p": "v", "v": "(z - c*v - k*p)/m", "z": "(F - z)/tau"}
PLANT = replace(DEFICIENT, states=STATES, parameters={**DEFICIENT.parameters, "tau": Parameter(0.3, unit="s")})

CASE = Case(
    name="oscillator-actuator-lag",
    sentence="A mass moved by an actuator whose command is recorded, not its force; the actuator's lag is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(60.0, 0.1, (0.0, 0.0, 0.0), {"F": multisine(1.0, 0.05, 0.4, 12)}),
    missing=(Missing("actuator_lag", "F", {"tau": 0.3}),),
    tags=("mechanical", "input"),
)
