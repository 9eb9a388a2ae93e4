"""A spring whose force stops growing."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="saturation",
    term="-a*max(-w, min(w, p))",
    roles={"p": "position", "v": "rate"},
    sentence="A force grows with displacement up to a limit and then stays there.",
    dimension="1/time^2",
    inner={"w": Inner("spread", 0.2, 0.01, 0.5, (1.0, 0.4, 1.8))},
    family="the restoring force bends off at an amplitude",
    law="restoring",
)
