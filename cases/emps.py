"""A motor drives a carriage along a screw under feedback: dry friction is missing. Measured."""

from cases import _emps
from suite.case import Case
from suite.model import Initial, Input, Model, Output, Parameter

VOLTAGE = "kv*(kp*(qg - q) - v) + pulses"

CASE = Case(
    name="emps",
    sentence="A carriage driven under feedback against viscous friction alone; the dry friction is missing.",
    # The controller is known; its sampling at 1 kHz delays the motor by about a sample, here a lag.
    deficient=Model(
        name="carriage under feedback",
        states={"q": "v", "v": "(gtau*w - Fv*v - offset)/M", "w": f"({VOLTAGE} - w)/lag"},
        parameters={
            "kp": Parameter(160.18, fixed=True, unit="1/s"),
            "kv": Parameter(243.45, fixed=True, unit="V*s/m"),
            "gtau": Parameter(35.15065, fixed=True, unit="N/V"),
            "lag": Parameter(1e-3, fixed=True, unit="s"),
            "M": Parameter(95.0, unit="kg"),
            "Fv": Parameter(200.0, unit="N*s/m"),
            "offset": Parameter(0.0, free=True, unit="N"),
        },
        inputs={"qg": Input("qg", hold="linear"), "pulses": Input("pulses_N")},
        outputs={"vir": Output(VOLTAGE, column="vir")},
        initial={"q": Initial(0.0, estimate=True), "v": Initial(0.0, estimate=True), "w": Initial(0.0)},
        suspect=("v",),
    ),
    measured=_emps.measured,
    noises=(0.0,),
    held_out=_emps.held_out,
    tags=("measured", "mechanical", "large"),
)
