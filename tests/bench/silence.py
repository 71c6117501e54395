"""False alarms: machines that lack nothing, 100 as drawn and 60 mis-tuned.

Seeds 260000 and up, drawn after all that earlier ones had taught; cases that are done are kept: it
goes on from where it was.
"""

from tests.bench.diagnosis import Card, Deck, mixed, played

FIRST, NOTHING, MISTUNED = 260_000, 100, 60


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """All of them, mixed."""
    piles = [Card("nothing")] * NOTHING, [Card("mistuned")] * MISTUNED
    return Deck("silence", FIRST, mixed(piles))
