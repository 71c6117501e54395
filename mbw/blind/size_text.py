"""Text of a predicted size, with the digits that tell it from no effect."""

import math

_NEAR_ONE = 0.1  # a factor or gain: its difference from 1 is the effect


def size_text(value: float) -> str:
    """Return a size with three digits, and a factor near 1 with two of its difference from 1.

    ``sizeText`` in places_state.js does the same on pages.
    """
    off = abs(value - 1)
    if not 0 < off < _NEAR_ONE:
        return f"{value:.3g}"
    return f"{value:.{min(12, 1 - math.floor(math.log10(off)))}f}"
