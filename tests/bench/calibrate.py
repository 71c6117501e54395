"""The judgement's constants, by maximum likelihood on campaigns that no reported figure uses.

Of each calibration campaign the logarithm of the probability that its evidence gives the truth
counts: none, unexplained, or each cause at its place; of single ones likewise the share of the true
place. The campaigns: seeds 80000 and up, those of ``diagnosis``, effects that no catalogue has,
pairs; 86000 and up, effects so weak that some are hidden; 87000 and up, more outsiders and pairs;
160000 and up, those of ``diagnosis``, and 260000 and up, those of ``silence``, that were reported
once and are no more; 310000 and up and 320000 and up, weaker yet, in trees. A body that bends and
whose spare channels do not show it is one that nothing explains. Effects that re-tuning hides
entirely teach nothing and are left out, and so are outsiders of which less than the noise survives.
The constants go to ``diagnosis/inference/calibration.json``, with the SHA-256 of the evidence.
"""

import hashlib
import json
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from diagnosis.inference.calibration import Calibration
from diagnosis.inference.evidence import BENDS, Evidence
from diagnosis.inference.posterior import Posterior, judge
from identification.words import Real
from tests.bench import doubt, silence
from tests.bench.catalogue import LINEAR, outside, two
from tests.bench.diagnosis import NONLINEAR, Card, Deck, deck, made, mixed, shuffled
from truth.effects.outside import OUTSIDE

CASES, OUT, PAIRS, FIRST = 80, 2, 10, 80_000
WEAK, RATIOS, EMPTY = 86_000, (0.1, 0.2, 0.4), 20  # trees of stages with nothing missing
OTHERS, TIMES = 87_000, 3  # effects that no catalogue has, at any ratio, and pairs, in small trees
RETIRED, REPORTED_ONCE = 160_000, 325
FILE = Path(__file__).parents[2] / "diagnosis" / "inference" / "calibration.json"
_LEAST = 5e-3  # probability of the truth that a case counts at least: one outlier rules nothing
_WIDE = 0.7  # standard deviation of a constant's logarithm about where it begins
OPTIONS = {"maxfev": 8000, "xatol": 1e-3, "adaptive": True}
# Constants whose logarithms are fitted, and where they begin.
BEGIN = {
    "hidden.coherence": 0.08,
    "hidden.differences": 0.2,
    "hidden.lines": 8e-3,
    "hidden_width": 0.4,
    "told.coherence": 400.0,
    "told.differences": 700.0,
    "told.lines": 40.0,
    "told_width": 0.4,
    "exact.coherence": 0.02,
    "exact.differences": 0.05,
    "exact.lines": 0.01,
    "left.coherence": 0.15,
    "left.differences": 0.15,
    "left.lines": 0.05,
    "left_width": 0.4,
    "least": 10.0,
    "inexact": 3e-3,
    "temper": 3e-3,
    "rival": 3.0,
    "foretold": 300.0,
    "share": 0.1,
}
SOURCES = "coherence", "differences", "lines"
_OUTLIER, _SURE = 4.5, 0.98  # while the others are fitted
_BEYOND = 0.99  # of that: what leaves no doubt
_TAKEN = 0.25  # survival ratio: of an outsider below, effects that are alike take what is left
_Cause = tuple[str, str]  # effect, place
Causes = tuple[_Cause, ...]  # none where nothing is missing


def run() -> list[dict[str, object]]:
    """Make the campaigns, fit the constants, write them."""
    decks = dealt()
    made_of = [made(one) for one in decks]
    rows = [row for own in made_of for row in own]
    given = [one for row in rows if (one := given_of(row)) is not None]
    start = np.log(list(BEGIN.values()))

    def cost(logarithms: Real) -> float:
        by = _calibration(logarithms)
        prior = 0.5 * float((((logarithms - start) / _WIDE) ** 2).sum())
        return prior + sum(_surprise(judge(seen, by), truth) for seen, truth in given)

    found = minimize(cost, start, method="Nelder-Mead", options=OPTIONS)
    by = _calibration(found.x)
    by = by.model_copy(update={"sure": sure(by, given), **provenance(decks, made_of)})
    FILE.write_text(by.model_dump_json(indent=1) + "\n", encoding="utf-8")
    before, after = cost(start), cost(found.x)
    fitted: list[dict[str, object]] = [
        {"constant": name, "began": np.exp(a), "value": np.exp(b)}
        for name, a, b in zip(BEGIN, start, found.x, strict=True)
    ]
    mean = {
        "constant": f"nats a campaign, n = {len(given)}",
        "began": before / len(given),
        "value": after / len(given),
    }
    return [*fitted, mean]


def sure(by: Calibration, given: Sequence[tuple[Evidence, Causes]]) -> float:
    """How probable causes are that leave no doubt, where lines tell the gap: of today's fits.

    Of n of them k are true: the next is with probability (k + 1) / (n + 2), by the rule of
    succession (Laplace).

    Args:
        by: the other constants.
        given: evidence, and what is true.
    """
    own = by.model_copy(update={"sure": _SURE})
    right = [
        key[:2] in truth
        for seen, truth in given
        if seen.by == "lines"
        for key, probability in judge(seen, own).causes
        if probability >= _BEYOND * _SURE
    ]
    return round((sum(right) + 1) / (len(right) + 2), 4)


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
        "by_lines": sum(seen.by == "lines" for seen in given),
        "command": "make bench ONLY=calibrate",
        "seeds": ", ".join(map(_seeds, decks, made_of)),
        "commits": ", ".join(sorted({row.get("commit", "before rows named one") for row in rows})),
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


def _calibration(logarithms: Real) -> Calibration:
    named = dict(zip(BEGIN, np.round(np.exp(logarithms), 6).tolist(), strict=True))
    both = {
        name: {source: named.pop(f"{name}.{source}") for source in SOURCES}
        for name in ("hidden", "told", "exact", "left")
    }
    return Calibration.model_validate({**named, **both, "outlier": _OUTLIER, "sure": _SURE})


def given_of(row: dict) -> tuple[Evidence, Causes] | None:
    """Evidence, and what is true: effects and places, none where nothing is missing."""
    if row.get("verdict") is None:
        return None
    answer = tomllib.loads(row["answer"])
    seen = Evidence.model_validate(row["evidence"])
    causes = answer.get("cause", [] if answer["effect"] == "none" else [answer])
    if causes and not seen.proven and seen.is_noise:
        return None
    if answer["effect"] == "unexplained" and answer["ratio"] < _TAKEN:
        return None
    hidden = not any(effect == BENDS for effect, _, _ in seen.proven)
    found = ((one["effect"], one["location"]) for one in causes)
    return seen, tuple(
        ("unexplained" if effect == BENDS and hidden else effect, place) for effect, place in found
    )


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
