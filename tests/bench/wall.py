"""How long a diagnosis takes whoever waits for it: one after the other, on two cores.

Effects of the machine, in the station and in trees, such as no catalogue has, two at once, faults
of the measurement, and nothing missing. Seeds 340000 and up; cases that are done are kept: it goes
on from where it was.
"""

import time
from functools import partial

import numpy as np

from diagnosis import diagnose, verdict_of
from tests.bench.catalogue import LINEAR, outside, two
from tests.bench.diagnosis import MEASUREMENT, WORK, Card, Deck, ensure, mixed, shuffled
from tests.bench.kept import cases
from truth.grade.rates import wilson
from tuning import open_session

FIRST, CORES, LIMIT = 340_000, 2, 60.0  # s


def run() -> list[dict[str, object]]:
    """Draw and diagnose them; how many are done within a minute."""
    one = deck()
    rows, _ = cases(f"wall.{FIRST}", range(len(one.cards)), partial(case, one))
    drawn = [row for row in rows if row["seconds"] is not None]
    groups: dict[str, list[float]] = {}
    for row in drawn:
        for group in ("all", row["kind"]):
            groups.setdefault(group, []).append(row["seconds"])
    found: list[dict[str, object]] = []
    for group, own in groups.items():
        low, high = wilson(sum(one <= LIMIT for one in own), len(own))
        found.append(
            {
                "cases": group,
                "n": len(own),
                "median s": float(np.median(own)),
                "longest s": max(own),
                "within 60 s, %": 100 * float(np.mean([one <= LIMIT for one in own])),
                "95 %": f"{100 * low:.0f} to {100 * high:.0f}",
            }
        )
    return found


def deck() -> Deck:
    """All of them, mixed."""
    ratios = (2.0, 4.0)
    piles = [
        shuffled([Card("one", (name,), ratio) for ratio in ratios for name in LINEAR], 21),
        shuffled([Card("one", (name,), 2.0, tree=True) for name in LINEAR], 22),
        shuffled([Card("one", (name,), 4.0) for name in MEASUREMENT], 23),
        outside(2),
        two(24, 10),
        [Card("nothing")] * 10,
    ]
    return Deck("wall", FIRST, mixed(piles))


def case(one: Deck, number: int) -> dict[str, object]:
    """Draw and diagnose one case.

    Args:
        one: its deck.
        number: of the case.
    """
    seed, card = one.first + number, one.cards[number]
    row: dict[str, object] = {"seed": seed, "kind": card.kind, "effects": card.effects}
    if ensure(one, seed) is None:
        return row | {"seconds": None}
    begun = time.perf_counter()
    verdict = verdict_of(diagnose(open_session(WORK / f"{seed}"), jobs=CORES))
    seconds = time.perf_counter() - begun
    return row | {"seconds": seconds, "verdict": verdict.verdict}
