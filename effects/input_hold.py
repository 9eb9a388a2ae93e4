"""An input that is held otherwise between samples."""

from suite.effect import Effect

EFFECT = Effect(
    id="input_hold",
    term="+a*(held - u)",
    roles={"u": "input", "held": "held"},
    sentence="Between samples the input runs on a line where the model holds it, or is held where it runs on a line.",
    dimension="1",
    pinned=True,
    family="the input acts otherwise than it is recorded",
)
