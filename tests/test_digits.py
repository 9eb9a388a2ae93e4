"""Numbers are written to the digits that they have."""

from __future__ import annotations

import pytest

from suite.report.page import with_sd


@pytest.mark.parametrize(
    ("value", "sd", "text"), [(2.104, 0.083, "2.104 ± 0.083"), (2.1, 0.0, "2.1"), (812.4, 31.0, "812 ± 31")]
)
def test_digits_follow_the_sd(value: float, sd: float, text: str) -> None:
    """A value is written to the digit that its standard deviation reaches."""
    assert with_sd(value, sd) == text
