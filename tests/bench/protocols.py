"""What a test is worth: the same weak effects with one hammer point, two, and no coherence.

Each machine and effect is drawn once, with a survival ratio of 1 or of a tenth in the plain test,
and measured three times. Seeds 155000 and up; cases that are done are kept: it goes on from where
it was.
"""

from itertools import chain

from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, played

FIRST, EACH, RATIOS = 155_000, 2, (1.0, 0.1)
TESTS = ("plain", "two points", "no coherence")


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """Each effect twice at each ratio, in three tests each."""
    known = [name for name in LINEAR if name != "flexible_body"]
    effects = [(name, ratio) for ratio in RATIOS for name in known] * EACH
    cards = [
        [Card("one", (effect,), ratio, test=test, twin=len(TESTS) * number) for test in TESTS]
        for number, (effect, ratio) in enumerate(effects)
    ]
    return Deck("protocols", FIRST, tuple(chain.from_iterable(cards)))
