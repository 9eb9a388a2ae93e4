"""The silverbox, an electronic oscillator with a hardening spring, against a linear one. Measured."""

from cases import _silverbox
from suite.case import Case
from suite.model import Initial, Input, Model, Output, Parameter

CASE = Case(
    name="silverbox",
    sentence="An electronic oscillator against a linear model; the spring that hardens is missing.",
    # The generator is band-limited: its voltage runs on a line between samples. The amplifiers have an offset.
    deficient=Model(
        name="linear oscillator",
        states={"p": "v", "v": "b*(u - u0) - c*v - k*p"},
        parameters={
            "b": Parameter(2e5, unit="1/s^2"),
            "u0": Parameter(0.0, free=True, unit="V"),
            "c": Parameter(30.0, unit="1/s"),
            "k": Parameter(2e5, unit="1/s^2"),
        },
        inputs={"u": Input("V1", hold="linear")},
        outputs={"p": Output("p", column="V2")},
        initial={"p": Initial(0.0, estimate=True), "v": Initial(0.0, estimate=True)},
    ),
    measured=_silverbox.measured,
    noises=(0.0,),
    held_out=_silverbox.held_out,
    tags=("measured", "mechanical", "large"),
)
