"""False alarms: machines that lack nothing, 100 as drawn and 60 mis-tuned.

Seeds 270000 and up, drawn after all that earlier ones had taught; cases that are done are kept: it
goes on from where it was. Those of 260000 and up calibrate the judgement.
"""

from tests.bench.diagnosis import Card, Deck, mixed, played

FIRST, BEFORE, NOTHING, MISTUNED = 270_000, 260_000, 100, 60


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck(first: int = FIRST) -> Deck:
    """All of them, mixed.

    Args:
        first: seed; of those that calibrate it is ``BEFORE``.
    """
    piles = [Card("nothing")] * NOTHING, [Card("mistuned")] * MISTUNED
    return Deck("silence", first, mixed(piles))
