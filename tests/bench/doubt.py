"""Doubt: are causes stated with 0.6 or 0.9 true in six or nine of ten?

What a test shows well is told surely; so these are effects in random trees of three and four stages
of which a tenth to a fifth of the noise survives a refit of a plain test, and half as many lines,
hit less often: some are plain, some hidden, and some between. Seeds 320000 and up; cases that are
done are kept: it goes on from where it was. Those of 310000 and up, of whole tests, calibrate the
judgement.
"""

from itertools import product

from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, played, shuffled

FIRST, RATIOS, EACH = 320_000, (0.1, 0.2), 25  # of every effect, ratio and number of stages
BEFORE, LESS, MANY, MADE = 310_000, (0.07, 0.1, 0.14), 12, 273
STAGES = 3, 4


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """All of them, mixed."""
    known = [name for name in LINEAR if name != "flexible_body"]  # few channels show that it bends
    cards = [
        Card("one", (effect,), ratio, tree=True, stages=stages, test="short")
        for effect, ratio, stages in product(known, RATIOS, STAGES)
    ]
    return Deck("doubt", FIRST, tuple(shuffled(cards * EACH, 4)))


def before() -> Deck:
    """Those that calibrate."""
    cards = [
        Card("one", (effect,), ratio, tree=True, stages=stages)
        for effect, ratio, stages in product(LINEAR, LESS, STAGES)
    ]
    return Deck("doubt", BEFORE, tuple(shuffled(cards * MANY, 3)[:MADE]))
