"""A sensor that follows with a lag."""

from suite.effect import Added, Effect, Inner

EFFECT = Effect(
    id="sensor_lag",
    term="+a*(z - y)",
    roles={"y": "output"},
    sentence="The sensor follows with a first-order lag.",
    dimension="1",
    pinned=True,
    inner={"w": Inner("step", 3.0, 1.0, 1e3, (1.0, 4.0, 15.0))},
    states={"z": Added("(y - z)/w", start="y", free=True)},
    family="the measurement is at fault",
)
