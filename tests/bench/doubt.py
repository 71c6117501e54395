"""Doubt: are causes stated with 0.6 or 0.9 true in six or nine of ten?

What a test shows well is told surely; so these are weak effects in random trees of three and four
stages. At survival ratios of a half and of one nearly all are still told surely, as the first
hundred show; the others have a fifth. Seeds 300000 and up; cases that are done are kept: it goes on
from where it was.
"""

from itertools import product

from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, played, shuffled

FIRST = 300_000
RATIOS, STAGES, EACH = (0.5, 1.0), (3, 4), 7  # of every effect, ratio and number of stages
WEAK, TIMES = 0.2, 12


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """All of them, mixed."""
    first, weak = (
        [
            Card("one", (effect,), ratio, tree=True, stages=stages)
            for effect, ratio, stages in product(LINEAR, ratios, STAGES)
        ]
        for ratios in (RATIOS, (WEAK,))
    )
    cards = (*shuffled(first * EACH, 3)[:100], *shuffled(weak * TIMES, 4))
    return Deck("doubt", FIRST, cards)
