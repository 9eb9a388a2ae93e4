"""A planar arm with two links, both joints driven and read; dry friction in the elbow is missing."""

from suite.case import Case, Experiment, Missing
from suite.excitation import multisine
from suite.model import Initial, Input, Model, Output, Parameter

# M = [[A + 2 B cos q2, C + B cos q2], [C + B cos q2, C]],  M q'' = torque - Coriolis - k q - c q'.
ACROSS, DET = "(C + B*cos(q2))", "(A*C - C**2 - (B*cos(q2))**2)"
INERTIA = {"A": 3.2, "B": 0.9, "C": 0.8}
T1 = "(u1 + B*sin(q2)*(2*v1*v2 + v2**2) - k*q1 - c*v1)"
T2 = "(u2 - B*sin(q2)*v1**2 - k*q2 - c*v2)"
DEFICIENT = Model(
    name="two-link arm",
    states={
        "q1": "v1",
        "v1": f"(C*{T1} - {ACROSS}*{T2})/{DET}",
        "q2": "v2",
        "v2": f"((A + 2*B*cos(q2))*{T2} - {ACROSS}*{T1})/{DET}",
    },
    parameters={name: Parameter(value, fixed=True, unit="kg m^2") for name, value in INERTIA.items()}
    | {"k": Parameter(8.0, sd=0.4, unit="N m"), "c": Parameter(0.8, sd=0.08, unit="N m s")},
    inputs={"u1": Input("torque1"), "u2": Input("torque2")},
    outputs={"q1": Output("q1", column="q1"), "q2": Output("q2", column="q2")},
    initial={name: Initial(0.0) for name in ("q1", "v1", "q2", "v2")},
)
DRY = {"a": Parameter(0.9), "w": Parameter(0.02, fixed=True)}
PLANT = DEFICIENT.plus("v1", f"+a*{ACROSS}/{DET}*tanh(v2/w)", DRY)
PLANT = PLANT.plus("v2", f"-a*(A + 2*B*cos(q2))/{DET}*tanh(v2/w)", DRY)
TORQUES = {"u1": multisine(4.0, 0.1, 1, 8), "u2": multisine(1.5, 0.15, 1.2, 8, 1)}

CASE = Case(
    name="robot-arm",
    sentence="A two-link arm under random-phase torques; the elbow's dry friction is missing, which moves both joints.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(20.0, 0.04, (0.0,) * 4, TORQUES),
    missing=(Missing("coulomb_friction", "v1", {"a": 0.9}), Missing("coulomb_friction", "v2", {"a": 0.9})),
    tags=("mechanical", "robot", "outside"),
)
