"""What a test is worth: the same weak effects with one hammer point, two, and no coherence.

Each machine and effect is drawn once, with a survival ratio of 1 in the plain test, and measured
three times. Seeds 150000 and up; cases that are done are kept: it goes on from where it was.
"""

from itertools import chain

from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, played

FIRST, EACH, RATIO = 150_000, 3, 1.0
TESTS = ("plain", "two points", "no coherence")


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """Each effect three times, in three tests each."""
    effects = [name for name in LINEAR if name != "flexible_body"] * EACH
    cards = [
        [Card("one", (effect,), RATIO, test=test, twin=len(TESTS) * number) for test in TESTS]
        for number, effect in enumerate(effects)
    ]
    return Deck("protocols", FIRST, tuple(chain.from_iterable(cards)))
