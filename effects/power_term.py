"""A loss with a power of its own."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="power_term",
    term="-a*sign(D)*abs(D)**w",
    roles={"x": "any", "D": "deviation"},
    sentence="A loss grows with some power of the state that no simple law gives.",
    dimension="state^(1-w)/time",
    inner={"w": Inner("one", 1.5, 0.3, 4.0, (1.0, 0.4, 2.0))},
    generic=True,
)
