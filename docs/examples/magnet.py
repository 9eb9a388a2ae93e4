"""A magnet beside the path."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="magnet",
    term="-a*p/(1 + (p/w)**2)**2",
    roles={"p": "position", "v": "rate"},
    sentence="A magnet near the middle of the path pulls with a force that fades with the distance.",
    dimension="1/time^2",
    inner={"w": Inner("spread", 0.3, 0.03, 3.0)},
)
