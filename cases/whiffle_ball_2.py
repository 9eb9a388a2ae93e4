"""A second whiffle ball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="whiffle-ball-2",
    what="a second whiffle ball",
    file="whiffle_ball_2",
    sums=(
        "0800161fceb8d7ab66ec4fcccebce9cdc2db768a9e7c95308ca68992d227d53c",
        "0066f19d3635d956388e730e4a83d0f823dab239dfe731893314e77507be3918",
    ),
)
