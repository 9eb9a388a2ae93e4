"""A spring that hardens or softens."""

from suite.effect import Effect

EFFECT = Effect(
    id="cubic_stiffness",
    term="-a*p**3",
    roles={"p": "position", "v": "rate"},
    sentence="A spring that hardens (or softens) with displacement, as geometry or material stretches.",
    dimension="1/(position^2 time^2)",
    family="the restoring force grows faster than the displacement",
    law="restoring",
)
