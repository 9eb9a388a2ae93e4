"""A spring that hardens steeply."""

from suite.effect import Effect

EFFECT = Effect(
    id="quintic_stiffness",
    term="-a*p**5",
    roles={"p": "position", "v": "rate"},
    sentence="A spring that hardens steeply near the end of its travel.",
    dimension="1/(position^4 time^2)",
    family="the restoring force grows faster than the displacement",
    law="restoring",
)
