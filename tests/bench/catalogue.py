"""Which effect, on withheld truth: every effect of the catalogue twenty times and more.

Effects of the machine, two effects at once, effects that no catalogue has, and effects in random
trees of stages. Seeds 180000 and up; cases that are done are kept: it goes on from where it was.
"""

from itertools import combinations

from tests.bench.diagnosis import MACHINE, NONLINEAR, Card, Deck, mixed, played, shuffled
from truth.effects.outside import OUTSIDE

FIRST = 180_000
LINEAR = tuple(name for name in MACHINE if name not in NONLINEAR)
RATIOS = (2.0, 4.0)
EACH, OUT, PAIRS, TREES = 10, 8, 30, 3  # of every effect and ratio; of all pairs
# Taught something: 3 and 16 that a dead channel misled what was asked of sensors before it, 28 that
# what an effect leaves is to be compared with what counts as nothing, 54 that far beginnings, and
# 48, 50 and 57 that all on their way to the weights of the noise, need the logarithm, 66 that a
# plate's twisting is no sensor's fault, 77 that a few lines beside sharp modes rule no comparison,
# 129 that fits which creep along a valley need the misfit's own curvature.
SPENT = 3, 16, 28, 48, 50, 54, 57, 66, 77, 129


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
    return Deck("catalogue", FIRST, mixed(piles), SPENT)


def outside(times: int) -> list[Card]:
    """Every effect that no catalogue has, so many times."""
    return [Card("outside", (name,), 4.0) for name in OUTSIDE] * times


def two(seed: int, count: int) -> list[Card]:
    """So many pairs of effects."""
    known = [name for name in LINEAR if name != "flexible_body"]  # it hides all others
    return shuffled([Card("two", pair, 4.0) for pair in combinations(known, 2)], seed)[:count]
