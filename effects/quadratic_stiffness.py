"""A spring that is stiffer on one side."""

from suite.effect import Effect

EFFECT = Effect(
    id="quadratic_stiffness",
    term="-a*p**2",
    roles={"p": "position", "v": "rate"},
    sentence="An asymmetric spring: stiffer in one direction than in the other.",
    dimension="1/(position time^2)",
    family="the restoring force depends on position",
    law="restoring",
)
