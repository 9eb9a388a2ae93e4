"""A basketball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="blue-basketball",
    what="a basketball",
    file="blue_basketball",
    sums=(
        "a74a3d9a4fe0dc472f444e33a20461af96d6b383a2276feaa065e8f283b9d613",
        "cc9734d7554f5cce9ff7870c95bd8ce0f473b193e34065cff25e413bd8b29b40",
    ),
)
