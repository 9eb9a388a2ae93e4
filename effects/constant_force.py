"""A force that does not change."""

from suite.effect import Effect

EFFECT = Effect(
    id="constant_force",
    term="+a",
    roles={"v": "rate"},
    sentence="A steady push: weight, a stuck valve, a bias of the actuator.",
    dimension="rate",
)
