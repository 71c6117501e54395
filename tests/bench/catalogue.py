"""Which effect, on withheld truth: every effect of the catalogue twenty times and more.

Effects of the machine, two effects at once, effects that no catalogue has, and effects in random
trees of stages. Seeds 290000 and up, all counted. Cases that are done are kept: it goes on from
where it was.
"""

from itertools import combinations

from tests.bench.diagnosis import MACHINE, NONLINEAR, Card, Deck, mixed, played, shuffled
from truth.effects.outside import OUTSIDE

FIRST = 290_000
LINEAR = tuple(name for name in MACHINE if name not in NONLINEAR)
RATIOS = (2.0, 4.0)
EACH, OUT, PAIRS, TREES = 10, 4, 20, 2  # of every effect and ratio; of all pairs


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    return played(deck())


def deck() -> Deck:
    """All of them, mixed."""
    one = [Card("one", (name,), ratio) for ratio in RATIOS for name in LINEAR] * EACH
    trees = [Card("one", (name,), ratio, tree=True) for ratio in RATIOS for name in LINEAR] * TREES
    piles = [
        shuffled(pile, 7 + number)
        for number, pile in enumerate((one, outside(OUT), two(11, PAIRS), trees))
    ]
    return Deck("catalogue", FIRST, mixed(piles))


def outside(times: int) -> list[Card]:
    """Every effect that no catalogue has, so many times."""
    return [Card("outside", (name,), 4.0) for name in OUTSIDE] * times


def two(seed: int, count: int) -> list[Card]:
    """So many pairs of effects."""
    known = [name for name in LINEAR if name != "flexible_body"]  # it hides all others
    return shuffled([Card("two", pair, 4.0) for pair in combinations(known, 2)], seed)[:count]
