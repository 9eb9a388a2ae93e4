"""A force with a memory of the motion."""

from suite.effect import Added, Effect, Inner

EFFECT = Effect(
    id="bouc_wen_hysteresis",
    term="-a*z",
    roles={"p": "position", "v": "rate"},
    sentence="Material yields: the force follows the motion but levels off, and remembers its way (Wen 1976).",
    dimension="1/time^2",
    inner={"w": Inner("spread", 0.1, 0.005, 1.0)},
    states={"z": Added("v - (abs(v)*z + v*abs(z))/(2*w)")},
    family="the force depends on the way the position was reached",
    law="memory",
)
