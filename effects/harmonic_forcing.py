"""A tone from outside."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="harmonic_forcing",
    term="+a*cos(w*t) + b*sin(w*t)",
    roles={"x": "any"},
    sentence="A machine nearby, an imbalance or the mains shakes the plant at one frequency.",
    dimension="rate",
    coefficients=("a", "b"),
    inner={"w": Inner("frequency", 3.0, 2.5, 1e9)},
    family="a force repeats at one frequency",
)
