"""A time axis that is stretched."""

from suite.effect import Effect

EFFECT = Effect(
    id="clock_rate",
    term="+a",
    roles={"f": "clock"},
    sentence="The time column runs too fast or too slow: a wrong sampling time, another unit of time.",
    dimension="1",
    least=-0.999,
    family="the measurement is at fault",
)
