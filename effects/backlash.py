"""A spring behind a play."""

from suite.effect import Added, Effect, Inner

EFFECT = Effect(
    id="backlash",
    term="-a*z",
    roles={"p": "position", "v": "rate"},
    sentence="A gear or linkage with play: what hangs behind it follows only when the play is used up.",
    dimension="1/time^2",
    inner={"w": Inner("spread", 0.1, 0.005, 0.5)},
    states={
        "z": Added(
            "0.5*max(v, 0)*(1 + tanh(20*((p - z)/w - 1))) + 0.5*min(v, 0)*(1 + tanh(20*((z - p)/w - 1)))",
            start="p",
            free=True,
        )
    },
    family="the force depends on the way the position was reached",
    law="memory",
)
