"""How probable today's constants find the truth, on campaigns that no reported figure uses.

Of each calibration campaign the logarithm of the probability that its evidence gives the truth
counts: none, unexplained, or each cause at its place; of single ones likewise the share of the true
place. The campaigns: seeds 80000 and up, those of ``diagnosis``, effects that no catalogue has,
pairs; 86000 and up, effects so weak that some are hidden; 87000 and up, more outsiders and pairs;
160000 and up, those of ``diagnosis``, and 260000 and up, those of ``silence``, that were reported
once and are no more; 310000 and up and 320000 and up, weaker yet, in trees. Outsiders of which less
than a quarter of the noise survives teach nothing and are left out.
"""

import hashlib
import json
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from diagnosis.inference.evidence import Evidence
from diagnosis.inference.posterior import Posterior, judge
from tests.bench import doubt, silence
from tests.bench.catalogue import LINEAR, outside, two
from tests.bench.diagnosis import NONLINEAR, Card, Deck, deck, made, mixed, shuffled, stale
from truth.effects.outside import OUTSIDE

CASES, OUT, PAIRS, FIRST = 80, 2, 10, 80_000
WEAK, RATIOS, EMPTY = 86_000, (0.1, 0.2, 0.4), 20  # trees of stages with nothing missing
OTHERS, TIMES = 87_000, 3  # effects that no catalogue has, at any ratio, and pairs, in small trees
RETIRED, REPORTED_ONCE = 160_000, 325
_LEAST = 5e-3  # probability of the truth that a case counts at least: one outlier rules nothing
_TAKEN = 0.25  # survival ratio: of an outsider below, effects that are alike take what is left
_Cause = tuple[str, str]  # effect, place
Causes = tuple[_Cause, ...]  # none where nothing is missing


def run() -> list[dict[str, object]]:
    """Make the campaigns, and judge them by the committed constants."""
    rows = [row for one in dealt() for row in made(one, stale)]
    given = [one for row in rows if (one := given_of(row)) is not None]
    nats = [_surprise(judge(seen), truth) for seen, truth in given]
    figure = {"figure": "nats a campaign", "value": float(np.mean(nats)), "n": len(nats)}
    return [figure]


def provenance(decks: Sequence[Deck], made_of: Sequence[Sequence[dict]]) -> dict[str, object]:
    """What the constants are made from.

    Args:
        decks: of campaigns.
        made_of: the rows of each.
    """
    rows = [row for own in made_of for row in own]
    given = [seen for row in rows if (one := given_of(row)) is not None for seen in one[:1]]
    return {
        "campaigns": len(given),
        "command": "make bench ONLY=calibrate",
        "seeds": ", ".join(map(_seeds, decks, made_of)),
        "evidence": hashed(rows),
    }


def dealt() -> tuple[Deck, ...]:
    """Campaigns that are never reported, and those that were once and are no more."""
    once = deck("diagnosis", RETIRED, REPORTED_ONCE), silence.deck(silence.BEFORE)
    return cards(), weak(), others(), *once, *doubt.before()


def hashed(rows: Sequence[dict]) -> str:
    """SHA-256 of what the rows hold of seeds, evidence and answers."""
    kept = [[row["seed"], row.get("evidence"), row.get("answer")] for row in rows]
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def cards() -> Deck:
    """Those of ``diagnosis`` and, beside them, outsiders and pairs."""
    more = mixed([outside(OUT), two(13, PAIRS)])
    return Deck("calibrate", FIRST, (*deck("calibrate", FIRST, CASES).cards, *more))


def weak() -> Deck:
    """Every effect, from what nobody can see to what is plain, in trees and in the station."""
    tree = [
        Card("one", (name,), ratio, tree=True, stages=stages)
        for name, ratio, stages in product(LINEAR, RATIOS, (3, 4))
    ]
    station = [Card("one", (name,), ratio) for name, ratio in product(LINEAR, RATIOS[1:])]
    piles = [shuffled(tree * 2, 5), shuffled(station, 6), [Card("nothing", tree=True)] * EMPTY]
    return Deck("calibrate", WEAK, mixed(piles))


def others() -> Deck:
    """What no single effect explains, weak and strong, in trees."""
    strange = [
        Card("outside", (name,), ratio, tree=True, stages=4)
        for name, ratio in product(OUTSIDE, (0.5, 1.0, 4.0))
    ]
    pairs = [replace(card, tree=True, stages=4) for card in two(17, 15)]
    return Deck("calibrate", OTHERS, mixed([shuffled(strange * TIMES, 8), pairs]))


def _seeds(one: Deck, rows: Sequence[dict]) -> str:
    """Those of a deck, and how many of them are there."""
    return f"{one.first} to {one.first + len(one.cards) - 1} ({len(rows)})"


def given_of(row: dict) -> tuple[Evidence, Causes] | None:
    """Evidence, and what is true: effects and places, none where nothing is missing."""
    if row.get("verdict") is None:
        return None
    answer = tomllib.loads(row["answer"])
    seen = Evidence.model_validate(row["evidence"])
    causes = answer.get("cause", [] if answer["effect"] == "none" else [answer])
    if answer["effect"] == "unexplained" and answer["ratio"] < _TAKEN:
        return None
    return seen, tuple((one["effect"], one["location"]) for one in causes)


def _surprise(found: Posterior, causes: Causes) -> float:
    """-ln of the probability of the truth; of a single cause also of the share of its place."""
    if not causes:
        return _nats(found.none)
    present = [sum(p for key, p in found.causes if key[:2] == one) for one in causes]
    if len(causes) > 1:
        return sum(map(_nats, present))
    ((effect, place),) = causes
    right = found.unexplained if effect in ("unexplained", *NONLINEAR) else present[0]
    return _nats(right) + _nats(dict(found.where).get(place, 0.0))


def _nats(probability: float) -> float:
    return -float(np.log(max(probability, _LEAST)))
