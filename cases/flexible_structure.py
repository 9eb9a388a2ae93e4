"""A flexible structure with ten modes, two sensors and a shaker; the first mode hardens."""

import math

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

MODES = range(1, 11)
SHAPES = {k: [math.sin(k * math.pi * place) for place in (0.23, 0.41, 0.77)] for k in MODES}
STATES = {f"q{k}": f"r{k}" for k in MODES} | {
    f"r{k}": f"-2*zeta*w{k}*r{k} - w{k}**2*q{k} + {SHAPES[k][0]:.6f}*F" for k in MODES
}
DEFICIENT = Model(
    name="ten linear modes",
    states=STATES,
    parameters={"zeta": Parameter(0.02, sd=0.002)}
    | {f"w{k}": Parameter(2.0 * k, sd=0.02 * k, unit="rad/s") for k in MODES},
    inputs={"F": Input("force")},
    outputs={f"s{j}": Output(" + ".join(f"({SHAPES[k][j]:.6f})*q{k}" for k in MODES), column=f"s{j}") for j in (1, 2)},
    initial={name: Initial(0.0) for name in STATES},
)
PLANT = DEFICIENT.plus("r1", "-a*q1**3", {"a": Parameter(3.0)})

CASE = Case(
    name="flexible-structure",
    sentence="A beam with ten modes, shaken at one place and measured at two; its first mode's hardening is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(30.0, 0.05, (0.0,) * 20, {"F": multisine(1.5, 0.1, 3.5, 24)}),
    missing=(Missing("cubic_stiffness", "r1", {"a": 3.0}),),
    tags=("mechanical", "large"),
)
