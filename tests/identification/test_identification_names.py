"""Shares as text have no exponent."""

import pytest

from identification.words import percent_text


@pytest.mark.parametrize(
    ("share", "digits", "text"),
    [
        (0.998, 2, "100 %"),
        (1.0, 2, "100 %"),
        (12.34, 3, "1234 %"),
        (0.0123, 2, "1.2 %"),
        (-0.02, 3, "-2 %"),
        (3.1e-7, 2, "0.000031 %"),
        (0.0, 2, "0 %"),
    ],
)
def test_a_share_is_a_percentage_without_an_exponent(share, digits, text):
    assert percent_text(share, digits) == text
