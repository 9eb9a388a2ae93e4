"""A sensor that clips."""

from suite.effect import Effect, Inner

EFFECT = Effect(
    id="sensor_saturation",
    term="+a*(min(y, w) - y)",
    forms=("+a*(max(y, w) - y)",),
    roles={"y": "output"},
    sentence="The sensor clips at one end of its range.",
    dimension="1",
    pinned=True,
    inner={"w": Inner("range", 0.97, 0.0, 1.0, (1.0, 0.9, 0.7, 0.3, 0.1, 0.03))},
    family="the measurement is at fault",
)
