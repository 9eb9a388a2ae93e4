"""Weight on an arm, or a magnet: a force with the sine of an angle."""

from suite.effect import Effect

EFFECT = Effect(
    id="sine_stiffness",
    term="-a*sin(p)",
    roles={"p": "angle", "v": "rate"},
    sentence="Gravity on an arm, or a magnet, pulls back with the sine of the angle.",
    dimension="1/time^2",
    family="the restoring force depends on position",
    law="restoring",
)
