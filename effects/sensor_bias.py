"""A sensor with an offset."""

from suite.effect import Effect

EFFECT = Effect(
    id="sensor_bias",
    term="+a",
    roles={"y": "output"},
    sentence="The sensor reads too high or too low by a constant.",
    dimension="output",
    family="the measurement is at fault",
)
