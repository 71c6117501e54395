"""The diagnosis on withheld truth: 325 campaigns of the station, drawn, diagnosed and graded.

100 have nothing missing, 60 are mis-tuned only, the others one effect each, at survival ratios 2,
4 and 8. ``ONLY=diagnosis`` makes the reported campaigns, seeds 220000 and up. ``ONLY=calibrate``
makes others, seeds 80000 and up, and fits the judgement's constants to them, which it writes to
``diagnosis/inference/calibration.json``. Cases that are done are kept: both go on from where they
were. Every twentieth is diagnosed by two threads too, which must say the same to the last digit.
"""

import json
import resource
import subprocess
import time
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from rich.console import Console
from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose, read_fault, refit_true_cause
from diagnosis.inference.evidence import Evidence, Scored
from diagnosis.inference.posterior import compute_posterior
from diagnosis.settings import SETTINGS
from identification import Fault
from tests.bench.kept import cases, only_kept
from truth import (
    Cause,
    Plan,
    Protocol,
    Wanted,
    draw_campaign,
    draw_protocol,
    read_station,
    write_answer,
    write_campaign,
)
from truth.errors import NoPlaceError
from truth.grade import CaseFiles, grade, nearest_ratio, tables, to_json
from truth.machine.random_tree import draw_tree
from truth.machine.station import Station
from tuning import open_session

STATION = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"
RESULTS = Path(__file__).parent / "results"
WORK = Path(__file__).parent / "work"
CASES, FIRST, JOBS = 325, 220_000, 2
TWICE = 20  # every so manyth is diagnosed by two threads too
MEASUREMENT = (
    "drift",
    "hammer_misalignment",
    "mount_resonance",
    "sensor_delay",
    "sensor_gain",
    "sensor_misalignment",
    "sensor_polarity",
    "sensor_position",
    "sensor_swap",
)
MACHINE = (
    "appendage",
    "backlash",
    "feedback_delay",
    "flexible_body",
    "friction",
    "gyroscopic",
    "hardening",
    "joint_coupling",
    "mass_error",
    "missing_dof",
    "parallel_path",
    "structural_damping",
    "support_loss",
    "viscoelastic",
)
NONLINEAR = ("backlash", "friction", "hardening")
RATIOS = (2.0, 4.0, 8.0)
RIGID = 2  # directions of every machine that are rigid, for one of them may be what is missing


@dataclass(frozen=True)
class Card:
    """A case to be drawn.

    Args:
        kind: nothing, mistuned, one, two or outside.
        effects: what is missing.
        ratio: survival ratio of each.
        tree: whether the machine is a random tree of stages instead of the station.
        stages: of a tree; drawn if None.
        test: how it is measured: as drawn, or ``plain``, ``two points``, ``no coherence``,
            ``short``; sizes of effects are those for the plain test then.
        twin: number of the card that has the same machine and effects; None for its own.
    """

    kind: str
    effects: tuple[str, ...] = ()
    ratio: float = 0.0
    tree: bool = False
    stages: int | None = None
    test: str = "drawn"
    twin: int | None = None


@dataclass(frozen=True)
class Deck:
    """Cards of a bench; the first of them has the first seed.

    Args:
        name: of the bench.
        first: seed.
        cards: what is drawn.
    """

    name: str
    first: int
    cards: tuple[Card, ...]


def mixed(piles: Sequence[Sequence[Card]]) -> tuple[Card, ...]:
    """Cards so mixed that any first part holds some of every pile."""
    order = [
        (place / len(pile), number, card)
        for number, pile in enumerate(piles)
        for place, card in enumerate(pile)
    ]
    return tuple(card for _, _, card in sorted(order, key=lambda one: one[:2]))


def shuffled(cards: Sequence[Card], seed: int) -> list[Card]:
    """The same in another order."""
    return [cards[k] for k in np.random.default_rng(seed).permutation(len(cards))]


def deck(name: str, first: int, count: int) -> Deck:
    """Nothing missing 100, mis-tuned 60, and one effect each; so many of the first of them."""
    single = [Card("one", (name,), ratio) for ratio in RATIOS for name in MEASUREMENT] * 3
    single += [Card("one", (name,), ratio) for ratio in RATIOS for name in MACHINE] * 2
    piles = [[Card("nothing")] * 100, [Card("mistuned")] * 60, shuffled(single, 5)]
    return Deck(name, first, mixed(piles)[:count])


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade the reported campaigns."""
    return played(deck("diagnosis", FIRST, CASES))


def played(one: Deck) -> list[dict[str, object]]:
    """Make what is missing of a deck, then its figures."""
    return graded(one, made(one, stale))


def made(one: Deck, anew: Callable[[dict], bool] | None = None) -> list[dict]:
    """Rows of a deck, in the order of its cards: any first part of them holds some of all kinds.

    Args:
        one: the deck.
        anew: which of the rows that are kept are to be made again.
    """
    name = f"{one.name}.{one.first}"  # other seeds are other cases
    rows, _ = cases(name, range(len(one.cards)), partial(case, one), JOBS, anew)
    return rows


def stale(row: dict) -> bool:
    """Whether today's judgement says something else of the evidence: then all is made anew."""
    if row.get("verdict") is None:
        return False
    try:
        found = compute_posterior(Evidence.model_validate(row["evidence"]))
    except ValidationError:  # of a diagnosis before this one
        return True
    first = [(one["effect"], one["location"]) for one in row["verdict"]["causes"][:1]]
    return [key[:2] for key, _ in found.causes[:1]] != first


def rejudged(row: dict) -> dict:
    """A kept verdict with the probabilities that today's judgement gives its evidence."""
    told = row["verdict"]
    if told is None or stale(row):
        return told
    found = compute_posterior(Evidence.model_validate(row["evidence"]))
    of_sites: dict[tuple[str, str], float] = {}
    for key, probability in found.causes:
        of_sites.setdefault(key[:2], probability)
    shares = dict(found.where)
    causes = [
        one | {"probability": of_sites[one["effect"], one["location"]]}
        for one in told["causes"]
        if (one["effect"], one["location"]) in of_sites
    ]
    where = [
        one if one["share"] is None else one | {"share": shares.get(one["location"], 0.0)}
        for one in told["where"]
    ]
    probability = {word: getattr(found, word) for word in ("none", "unexplained", "several")}
    named = {f"{one['effect']}@{one['location']}" for one in causes}
    now = (tuple(map("@".join, pair)) for pair in found.confounded())
    twins = {frozenset(pair) for pair in (*map(tuple, told["twins"]), *now)}
    return told | {
        "twins": sorted(sorted(pair) for pair in twins if pair <= named),
        "probability": probability,
        "where": sorted(where, key=lambda one: -(one["share"] or 0.0)),
        "causes": sorted(causes, key=lambda one: -one["probability"]),
    }


def case(one: Deck, number: int) -> dict[str, object]:
    """Draw and diagnose one case.

    Args:
        one: its deck.
        number: of the case.
    """
    seed, card = one.first + number, one.cards[number]
    row: dict[str, object] = {"seed": seed, "card": asdict(card), "commit": _commit()}
    with threadpool_limits(1):
        drawn = ensure(one, seed)
        if drawn is None:
            return row | {"verdict": None}
        begun = time.process_time()
        try:
            found = diagnose(open_session(WORK / f"{seed}"))
            verdict = build_verdict(found)
        except Exception as error:  # a failure is graded as one, the other cases go on
            return row | {"answer": drawn, "error": f"{type(error).__name__}: {error}"}
        seconds = time.process_time() - begun
        told = read_fault(tomllib.loads(drawn))
        known = None if told is None else refit_true_cause(found, told)
        row["oracle"] = None if known is None else known.gap.excess
        row["ranks"] = None if told is None else ranks(found.evidence.scored, told)
        if number % TWICE == 0:
            row["same"] = build_verdict(diagnose(open_session(WORK / f"{seed}"), jobs=2)) == verdict
    # The judgement needs no scores.
    evidence = found.evidence.model_dump(mode="json", exclude={"scored"})
    kept = {"evidence": evidence, "verdict": verdict.model_dump(mode="json"), "answer": drawn}
    # Of the process, which made other cases before: never less than what this one took.
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return row | {"seconds": seconds, "gib": largest} | kept


@cache
def _commit() -> str:
    """Of the tree that makes a row."""
    asked = ("git", "rev-parse", "--short", "HEAD")
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


def ranks(scored: Sequence[Scored], told: Fault) -> list[int]:
    """Place of an effect at its place among all, by the score, from 1; empty without a score."""
    if not scored:
        return []
    gains = np.array([one.gain for one in scored])
    own = [(one.effect, one.location) == (told.effect, told.location) for one in scored]
    best = gains[own].max() if any(own) else -np.inf
    return [1 + int((gains > best).sum())]


def ensure(one: Deck, seed: int) -> str | None:
    """Draw a case unless it is there; its answer, None if the machine has no place for it."""
    card = one.cards[seed - one.first]
    place, answer = WORK / f"{seed}", WORK / f"{seed}.toml"
    if not answer.is_file():
        own = seed if card.twin is None else one.first + card.twin
        station = draw_tree(own, card.stages) if card.tree else read_station(STATION)
        wanted = tuple(Wanted(effect, None, card.ratio) for effect in card.effects)
        cause = Cause(wanted, mistuned=card.kind == "mistuned", kind=card.kind)
        try:
            drawn = draw_campaign(station, planned(station, own, cause, card.test))
        except NoPlaceError:
            return None
        write_campaign(drawn, place, overwrite=True, sealed=True)
        write_answer(drawn, answer)
    return answer.read_text("utf-8")


def _weakest(answer: str) -> str:
    """The nearest survival ratio of the cause that a refit hides most."""
    told = tomllib.loads(answer)
    ratios = [one.get("ratio") for one in told.get("cause", [told])]
    return nearest_ratio(None if None in ratios else min(ratios))


def _group(card: Card) -> str:
    """Which cases count together."""
    if card.kind != "one":
        return card.kind
    (effect,) = card.effects
    if effect in MEASUREMENT:
        return "measurement"
    group = "nonlinear" if effect in NONLINEAR else "linear"
    return f"{group} in trees" if card.tree else group


def planned(station: Station, seed: int, cause: Cause, test: str) -> Plan:
    """What is drawn of a card."""
    if test == "drawn":
        return Plan(seed, cause, draw_protocol(station, seed), rigid=RIGID)
    nodes = [node for stage in station.stages for node in sorted(s.node for s in stage.sensors)]
    first, second = np.random.default_rng(seed).permutation(nodes)[:2].tolist()
    plain = Protocol(nodes=(first,))
    tests = {
        "plain": plain,
        "two points": replace(plain, nodes=(first, second)),
        "no coherence": replace(plain, coherence=False),
        "short": replace(plain, lines=401, averages=4),
    }
    return Plan(seed, cause, tests[test], rigid=RIGID, sized_by=plain)


def graded(one: Deck, rows: Sequence[dict]) -> list[dict[str, object]]:
    """Grade kept verdicts; grades and tables lie among the results.

    Baselines, which need what was measured, are graded on the campaigns that are still there.
    """
    given = []
    WORK.mkdir(exist_ok=True)
    for row in rows:
        if "error" not in row and row["verdict"] is None:  # the machine has no place for it
            continue
        seed, card = row["seed"], one.cards[row["seed"] - one.first]
        verdict, refit, known = (
            WORK / f"{seed}.{what}.json" for what in ("verdict", "refit", "oracle")
        )
        (WORK / f"{seed}.graded.toml").write_text(row["answer"], encoding="utf-8")
        for file in (verdict, known):
            file.unlink(missing_ok=True)
        if "error" not in row:
            verdict.write_text(json.dumps(rejudged(row)), encoding="utf-8")
            excess = row["verdict"]["gap"]["retuned"]["excess"]
            refit.write_text(json.dumps({"excess": excess}), encoding="utf-8")
            if row.get("oracle") is not None:
                known.write_text(json.dumps({"excess": row["oracle"]}), encoding="utf-8")
        group = _group(card)
        tags = (group, f"{group} at {_weakest(row['answer'])}") if card.effects else (group,)
        if card.test != "drawn":
            tags = (*tags, card.test, f"{card.test} at {card.ratio:g}")
        given.append(
            CaseFiles(
                str(seed),
                WORK / f"{seed}",
                verdict,
                WORK / f"{seed}.graded.toml",
                refit,
                known if known.is_file() else None,
                tags=tags,
            )
        )
    report = grade(given)
    if only_kept():  # campaigns, and so baselines, may be gone
        Console().print(tables(report), markup=False, soft_wrap=True)
    else:
        (RESULTS / f"{one.name}.grades.json").write_text(to_json(report) + "\n", encoding="utf-8")
        (RESULTS / f"{one.name}.txt").write_text(tables(report), encoding="utf-8")
    seconds = np.array([row["seconds"] for row in rows if "seconds" in row])
    groups: dict[str, list[float]] = {}
    for row in rows:
        if "seconds" in row:
            groups.setdefault(_group(one.cards[row["seed"] - one.first]), []).append(row["seconds"])
    asked = [row["ranks"] for row in rows if row.get("ranks")]
    twice = [row["same"] for row in rows if "same" in row]
    return [
        {"figure": "cases", "value": len(rows), "n": len(one.cards)},
        {"figure": "core seconds, median", "value": float(np.median(seconds)), "n": len(seconds)},
        {"figure": "core seconds, 95 %", "value": float(np.quantile(seconds, 0.95)), "n": ""},
        {
            "figure": "core seconds above 30, %",
            "value": 100 * float((seconds > 30).mean()),
            "n": len(seconds),
        },
        *(
            {
                "figure": f"core seconds, median, {group}",
                "value": float(np.median(own)),
                "n": len(own),
            }
            for group, own in sorted(groups.items())
        ),
        {"figure": "GiB at most", "value": max(row.get("gib", 0.0) for row in rows), "n": ""},
        {"figure": "same verdict with two threads", "value": sum(twice), "n": len(twice)},
        *(
            {
                "figure": f"truth among {many} by score, %",
                "value": 100 * float(np.mean([one[0] <= many for one in asked])) if asked else 0.0,
                "n": len(asked),
            }
            for many in (1, SETTINGS.max_refits)
        ),
    ]
