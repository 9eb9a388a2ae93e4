"""A sensor with a wrong scale."""

from suite.effect import Effect

EFFECT = Effect(
    id="sensor_scale",
    term="+a*y",
    roles={"y": "output"},
    sentence="The sensor reads too much or too little by a factor: a wrong calibration or unit.",
    dimension="1",
    family="the measurement is at fault",
)
