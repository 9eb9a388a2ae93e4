"""A stop at one end of the travel."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="hard_stop",
    term="-a*max(p - w, 0)",
    forms=("+a*max(w - p, 0)",),
    roles={"p": "position", "v": "rate"},
    sentence="At one end of its travel the part runs against a stiff stop.",
    dimension="1/time^2",
    sign=1,
    inner={"w": Inner("range", 0.9, 0.02, 0.98, (1.0, 0.85, 0.65, 0.45, 0.25, 0.1))},
    family="the restoring force bends off at an amplitude",
    law="restoring",
)
