"""Heat carried off by evaporation."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="evaporation",
    term="-a*(exp(w*D) - 1)",
    roles={"x": "state", "K": "temperature", "D": "deviation"},
    sentence="Vapour pressure, and with it the heat lost to evaporation, rises exponentially with temperature.",
    dimension="temperature/time",
    sign=1,
    inner={"w": Inner("one", 0.05, 0.03, 0.07)},
    family="the loss grows faster than proportionally",
    law="loss",
)
