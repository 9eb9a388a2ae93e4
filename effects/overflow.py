"""A vessel that runs over."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="overflow",
    term="-a*max(x - w, 0)",
    roles={"x": "content"},
    sentence="Above a level the vessel runs over.",
    dimension="1/time",
    sign=1,
    inner={"w": Inner("range", 0.9, 0.02, 0.99, (1.0, 0.85, 0.7, 0.5))},
    family="the loss grows faster than proportionally",
    law="loss",
)
