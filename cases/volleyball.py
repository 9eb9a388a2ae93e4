"""A volleyball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="volleyball",
    what="a volleyball",
    file="volleyball",
    sums=(
        "dc61792b4d1d2099aa4b9028a9a7327135a1ec847670c254ec239abfb825ee26",
        "ecfe12118d39695e7a6bd3193d3c6219ee1da5b5a45957c029cf70b44cee7cba",
    ),
)
