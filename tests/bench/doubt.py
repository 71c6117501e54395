"""Doubt: are causes stated with 0.6 or 0.9 true in six or nine of ten?

What a test shows well is told surely; so these are effects in random trees of three and four stages
of which a fifteenth to a seventh of the noise survives a refit: some are plain, some hidden, and
some between. Seeds 310000 and up; cases that are done are kept: it goes on from where it was.
"""

from itertools import product

from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, played, shuffled

FIRST = 310_000
RATIOS, STAGES, EACH = (0.07, 0.1, 0.14), (3, 4), 12  # of every effect, ratio and number of stages


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """All of them, mixed."""
    cards = [
        Card("one", (effect,), ratio, tree=True, stages=stages)
        for effect, ratio, stages in product(LINEAR, RATIOS, STAGES)
    ]
    return Deck("doubt", FIRST, tuple(shuffled(cards * EACH, 3)))
