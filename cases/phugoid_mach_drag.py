"""The phugoid of an aircraft near the speed of sound, whose model's drag knows nothing of Mach numbers."""

from suite.case import Case, Experiment, Missing
from suite.excitation import steps
from suite.model import Initial, Input, Model, Output, Parameter

# Drag is D V^2 plus what lift induces; lift balances weight at 240 m/s.
DEFICIENT = Model(
    name="phugoid",
    states={"V": "thrust - D*V**2 - g*sin(gam)", "gam": "g*V/Vt**2 - g*cos(gam)/V"},
    parameters={
        "g": Parameter(9.81, fixed=True, unit="m/s^2"),
        "D": Parameter(1.2e-5, sd=6e-7, unit="1/m"),
        "Vt": Parameter(240.0, sd=2.4, unit="m/s"),
    },
    inputs={"thrust": Input("thrust_to_mass")},
    outputs={"V": Output("V", column="airspeed"), "gam": Output("gam", column="path_angle")},
    initial={"V": Initial(225.0, estimate=True), "gam": Initial(0.0, estimate=True)},
)
PLANT = DEFICIENT.plus("V", "-a*max(V - Vc, 0)**2", {"a": Parameter(3e-3), "Vc": Parameter(235.0, fixed=True)})

CASE = Case(
    name="phugoid-mach-drag",
    sentence="A phugoid with thrust steps, speed and path angle measured; the drag rise above 235 m/s is missing.",
    deficient=DEFICIENT,
    truth=PLANT,
    experiment=Experiment(300.0, 1.0, (225.0, 0.0), {"thrust": lambda t: 0.7 + steps(0.3, 30.0)(t)}),
    missing=(Missing("mach_drag", "V", {"a": 3e-3}),),
    tags=("aircraft", "fluid", "outside"),
)
