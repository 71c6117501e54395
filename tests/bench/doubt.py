"""Doubt: are causes stated with 0.6 or 0.9 true in six or nine of ten?

What a test shows well is told surely; so these are effects in random trees of three and four stages
of which a tenth to a fifth of the noise survives a refit of a plain test, and half as many lines,
hit less often: some are plain, some hidden, and some between. Seeds 330000 and up; cases that are
done are kept: it goes on from where it was. Those of 310000 and up, of whole tests, and of 320000
and up calibrate the judgement.
"""

import tomllib
from collections.abc import Sequence
from itertools import product

from tests.bench import catalogue, protocols
from tests.bench.catalogue import LINEAR
from tests.bench.diagnosis import Card, Deck, played, rejudged, shuffled
from tests.bench.kept import of
from truth.grade.rates import diagram_of

FIRST, RATIOS, EACH = 330_000, (0.1, 0.2), 25  # of every effect, ratio and number of stages
BEFORE, LESS, MANY, WHOLE = 310_000, (0.07, 0.1, 0.14), 12, 273
ONCE, SHORT = 320_000, 674
STAGES = 3, 4
REPORTED = ("doubt", FIRST), ("catalogue", catalogue.FIRST), ("protocols", protocols.FIRST)


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade them; then how true all causes are that reported campaigns state."""
    found = played(deck())
    rows = [row for name, first in REPORTED for row in of(f"{name}.{first}").values()]
    return [*found, *reliability(rows)]


def reliability(rows: Sequence[dict]) -> list[dict[str, object]]:
    """Of causes stated with so much probability how many are true, with Wilson's interval.

    Args:
        rows: of any benches.
    """
    stated: list[tuple[float, bool]] = []
    for row in rows:
        if row.get("verdict") is not None:
            answer = tomllib.loads(row["answer"])
            truth = {(one["effect"], one.get("location")) for one in answer.get("cause", [answer])}
            stated += [
                (one["probability"], (one["effect"], one["location"]) in truth)
                for one in rejudged(row)["causes"]
            ]
    return [
        {
            "figure": f"true of causes stated {one.low:g} to {one.high:g}, {one.stated:.3f} in the "
            f"mean, of doubt, catalogue and protocols, % [{one.true.low:.3f}, {one.true.high:.3f}]",
            "value": 100 * one.true.rate,
            "n": one.true.n,
        }
        for one in diagram_of(stated).bins
        if one.stated is not None and one.true.rate is not None
    ]


def deck(first: int = FIRST) -> Deck:
    """All of them, mixed.

    Args:
        first: seed.
    """
    known = [name for name in LINEAR if name != "flexible_body"]  # few channels show that it bends
    cards = [
        Card("one", (effect,), ratio, tree=True, stages=stages, test="short")
        for effect, ratio, stages in product(known, RATIOS, STAGES)
    ]
    return Deck("doubt", first, tuple(shuffled(cards * EACH, 4)))


def before() -> tuple[Deck, Deck]:
    """Those that calibrate."""
    cards = [
        Card("one", (effect,), ratio, tree=True, stages=stages)
        for effect, ratio, stages in product(LINEAR, LESS, STAGES)
    ]
    whole = Deck("doubt", BEFORE, tuple(shuffled(cards * MANY, 3)[:WHOLE]))
    return whole, Deck("doubt", ONCE, deck(ONCE).cards[:SHORT])
