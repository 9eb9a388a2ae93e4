"""A whiffle ball falls 47 m, filmed twice: gravity alone is not enough. Measured."""

from pathlib import Path

from cases._falling_ball import FREE_FALL, drops, source
from suite.case import Case
from suite.record import Record

SOURCE = source(
    "whiffle_ball_1",
    (
        "11abd9df6a74d2e9b4c9800d7adbb7187d5af20858ec0536b34125ea14f04398",
        "c9f8dd0fa7ef5419a84702e5ba1bd3867b0675c43d9b5a3d85220d76e9a12e19",
    ),
)


def measured(folder: Path | None) -> Record:
    """Both drops, so that the whole story can be told from one record; the last of several runs is held out anyway."""
    return drops(SOURCE, folder)


CASE = Case(
    name="whiffle-ball",
    sentence="Two drops of a whiffle ball against free fall; the air's drag is missing.",
    deficient=FREE_FALL,
    measured=measured,
    noises=(0.0,),
    tags=("measured", "mechanical"),
)
