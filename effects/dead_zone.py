"""A spring that engages beyond a gap."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="dead_zone",
    term="-a*(p - max(-w, min(w, p)))",
    roles={"p": "position", "v": "rate"},
    sentence="A force acts only beyond a gap on either side: clearance, a loose mount.",
    dimension="1/time^2",
    inner={"w": Inner("spread", 0.2, 0.01, 0.5, (1.0, 0.4, 1.8))},
    family="the restoring force bends off at an amplitude",
    law="restoring",
)
