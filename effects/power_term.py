"""A loss with a power of its own."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="power_term",
    # Over a reference, so that coefficient and exponent do not trade units.
    term="-a*sign(D)*abs(D/s)**w",
    roles={"x": "any", "D": "deviation"},
    sentence="A loss grows with some power of the state that no simple law gives.",
    dimension="state/time",
    inner={"w": Inner("one", 1.5, 0.3, 4.0, (1.0, 0.4, 2.0)), "s": Inner("spread", 1.0, 1.0, 1.0)},
    generic=True,
)
