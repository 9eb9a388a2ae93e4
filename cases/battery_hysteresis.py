"""A battery cell whose voltage depends on whether it was charged or discharged last."""

from dataclasses import replace

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

DEFICIENT = Model(
    name="cell with one resistor-capacitor pair",
    states={"s": "-i/Q", "U": "i/C - U/(R1*C)"},
    parameters={
        "Q": Parameter(7200.0, fixed=True, unit="A s"),
        "C": Parameter(2000.0, sd=200.0, unit="F"),
        "R1": Parameter(0.02, sd=0.002, unit="Ohm"),
        "R0": Parameter(0.02, sd=0.001, unit="Ohm"),
        "E": Parameter(3.2, sd=0.03, unit="V"),
        "slope": Parameter(0.3, sd=0.06, unit="V"),
    },
    inputs={"i": Input("current")},
    outputs={"V": Output("E + slope*s - U - R0*i", column="voltage")},
    initial={"s": Initial(0.6), "U": Initial(0.0)},
)
# z goes to the sign of the current with the charge that flows (Plett's one-state hysteresis).
PLANT = replace(
    DEFICIENT,
    states={**DEFICIENT.states, "z": "r*(i - abs(i)*z)"},
    parameters={**DEFICIENT.parameters, "a": Parameter(0.03, unit="V"), "r": Parameter(0.01)},
    outputs={"V": Output("E + slope*s - U - R0*i - a*z", column="voltage")},
)

CASE = Case(
    name="battery-hysteresis",
    sentence="A cell cycled about 60 % of its charge, current and voltage measured; its hysteresis is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(5000.0, 10.0, (0.6, 0.0, 0.0), {"i": multisine(2.0, 4e-4, 8e-3, 10)}),
    missing=(Missing("voltage_hysteresis", "V", {"a": 0.03}),),
    tags=("electrical", "outside"),
)
