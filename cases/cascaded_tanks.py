"""Two tanks, the upper one draining into the lower one: they run over, which Torricelli's law omits. Measured."""

from cases import _cascaded_tanks
from suite.case import Case
from suite.model import Initial, Input, Model, Output, Parameter

CASE = Case(
    name="cascaded-tanks",
    sentence="Two tanks in cascade against Torricelli's law; that they run over is missing.",
    # The tanks are alike, levels are in volts of the sensor, which clips at 10 V; the pump starts at u0.
    # With the water of both as a state, what the upper tank spills into the lower one is a loss in one equation.
    deficient=Model(
        name="cascaded tanks",
        states={
            "upper": "k4*(u - u0) - k1*sqrt(abs(upper))",
            "both": "k4*(u - u0) - k3*sqrt(abs(both - upper))",
        },
        parameters={
            **{name: Parameter(0.05) for name in ("k1", "k3", "k4")},
            "u0": Parameter(0.0, free=True, unit="V"),
        },
        inputs={"u": Input("u")},
        outputs={"level": Output("min(both - upper, 10)", column="y")},
        initial={"upper": Initial(5.0, estimate=True), "both": Initial(10.0, estimate=True)},
    ),
    measured=_cascaded_tanks.measured,
    noises=(0.0,),
    held_out=_cascaded_tanks.held_out,
    tags=("measured", "fluid"),
)
