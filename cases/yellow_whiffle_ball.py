"""A large whiffle ball falls 47 m, filmed twice. Measured."""

from cases._falling_ball import ball

CASE = ball(
    name="yellow-whiffle-ball",
    what="a large whiffle ball",
    file="yellow_whiffle_ball",
    sums=(
        "0cd36c9d8d91dc906de6b88d98f54030990d74165b1d161e69dcf13c7ec18877",
        "ae91a8ca0b293812600bfce64f59eb8fa53103f2255a15c96b0c976e063fc5e6",
    ),
)
