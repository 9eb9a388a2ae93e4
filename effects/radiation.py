"""Heat radiated to the surroundings."""

from suite.effect import Effect

EFFECT = Effect(
    id="radiation",
    term="-a*(K**4 - L**4)*1e-8",
    roles={"x": "state", "K": "temperature", "L": "level"},
    sentence="A warm surface radiates with the fourth power of its absolute temperature.",
    dimension="1e8/(temperature^3 time)",
    sign=1,
    family="the loss grows faster than proportionally",
    law="loss",
)
