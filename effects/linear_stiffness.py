"""A spring."""

from suite.effect import Effect

EFFECT = Effect(
    id="linear_stiffness",
    term="-a*p",
    roles={"p": "position", "v": "rate"},
    sentence="A spring pulls back in proportion to displacement.",
    dimension="1/time^2",
    family="the restoring force depends on position",
)
