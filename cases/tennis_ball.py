"""A tennis ball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="tennis-ball",
    what="a tennis ball",
    file="tennis_ball",
    sums=(
        "8b116ea584b0c62a9d3cae736c82618b3fdc822a13e6681c7811e26915103f28",
        "9911f709548ac718a37d37bc238a3acbe57f9a87b26c4efcfdf62051f71ea914",
    ),
)
