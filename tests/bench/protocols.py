"""What a test is worth: the same weak effects with one hammer point, two, and no coherence.

Each machine and effect is drawn once, with a survival ratio of 1 or of a tenth in the plain test,
and measured three times. Intervals of sizes are compared with those of the plain test, too.
Seeds 155000 and up; cases that are done are kept: it goes on from where it was.
"""

import tomllib
from collections.abc import Sequence
from itertools import chain, product

import numpy as np

from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, graded, made, stale
from truth.grade.rates import wilson

FIRST, EACH, RATIOS = 155_000, 2, (1.0, 0.1)
TESTS = ("plain", "two points", "no coherence")


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them."""
    one = deck()
    rows = made(one, stale)
    return [*graded(one, rows), *precision(rows)]


def precision(rows: Sequence[dict]) -> list[dict[str, object]]:
    """How wide intervals of sizes are in each test over those of the plain one.

    Of a machine the geometric mean over the parameters whose intervals both state, of the true
    cause; of all machines of a ratio the median, and how many intervals are narrower, with Wilson's
    interval of that.

    Args:
        rows: of this bench.
    """
    widths = {row["seed"] - FIRST: _widths(row) for row in rows}
    found: list[dict[str, object]] = []
    for test, ratio in product(range(1, len(TESTS)), RATIOS):
        cards = deck().cards
        own = [n for n, card in enumerate(cards) if (card.test, card.ratio) == (TESTS[0], ratio)]
        parts = [
            float(np.exp(np.mean([np.log(other[name] / plain[name]) for name in both])))
            for n in own
            for plain, other in [(widths.get(n, {}), widths.get(n + test, {}))]
            if (both := plain.keys() & other.keys())
        ]
        if parts:
            less = sum(part < 1 for part in parts)
            low, high = wilson(less, len(parts))
            name = f"width of intervals over those of the plain test, {TESTS[test]} at {ratio:g}"
            found.append({"figure": name, "value": float(np.median(parts)), "n": len(parts)})
            part = f"machines where they are narrower, {TESTS[test]} at {ratio:g}, %"
            told = f"{len(parts)} [{100 * low:.0f}, {100 * high:.0f}]"
            found.append({"figure": part, "value": 100 * less / len(parts), "n": told})
    return found


def _widths(row: dict) -> dict[str, float]:
    """Of the intervals of the true cause, by parameter; none where it was not found."""
    if row.get("verdict") is None:
        return {}
    truth = tomllib.loads(row["answer"])
    site = truth["effect"], truth["location"]
    causes = [one for one in row["verdict"]["causes"] if (one["effect"], one["location"]) == site]
    ends = causes[0]["interval"] or {} if causes else {}
    return {name: own[1] - own[0] for name, own in ends.items() if np.ndim(own) == 1}


def deck() -> Deck:
    """Each effect twice at each ratio, in three tests each."""
    known = [name for name in LINEAR if name != "flexible_body"]
    effects = [(name, ratio) for ratio in RATIOS for name in known] * EACH
    cards = [
        [Card("one", (effect,), ratio, test=test, twin=len(TESTS) * number) for test in TESTS]
        for number, (effect, ratio) in enumerate(effects)
    ]
    return Deck("protocols", FIRST, tuple(chain.from_iterable(cards)))
