"""Figures of the bench of real machines: rates with Wilson's intervals, time, two engines.

A row counts in the cell of the survival ratio that was drawn, the nearest of 2 and 4, which need
not be the one that was wanted.
"""

import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from statistics import fmean, median

from truth import TruthError
from truth.grade.answer import Truth, answer_from
from truth.grade.beside_background import (
    all_found,
    is_right,
    probability_on,
    right_first,
    truth_is_first,
    wrong_causes,
)
from truth.grade.paired import paired_difference
from truth.grade.rates import diagram_of, wilson
from truth.grade.read_verdict import verdict_from
from truth.grade.verdict import EXPLAINED, NOTHING_SAID, PARTLY, StatedVerdict

BETWEEN_2_AND_4 = 8**0.5  # survival ratio: the geometric mean
FORCE = ("hammer_gain", "hammer_delay")
GAIN_TO_BE_NAMED = 0.1  # |gain - 1| above it has to be named
SAID = (EXPLAINED, PARTLY)
POOLED_DIRT = (5, 15)  # per cent: the amounts that a rate is asked of


@dataclass(frozen=True)
class Graded:
    """A row with its answer and verdict read.

    Args:
        row: as kept.
        truth: what its machine has.
        verdict: ``NOTHING_SAID`` if the diagnosis failed or broke the contract.
    """

    row: dict
    truth: Truth
    verdict: StatedVerdict

    @property
    def cell(self) -> str:
        """Group of the table that the row counts in."""
        cell, dirt, ratio = self.row["cell"], self.row["dirt"], self.row["drawn_ratio"]
        if cell == "single":
            nearest = 4 if ratio is not None and ratio >= BETWEEN_2_AND_4 else 2
            return f"dirt {dirt:g} %, ratio {nearest}"
        if cell == "several":
            return f"{len(self.row['effects'])} effects"
        return str(cell)


Mark = Callable[[Graded], bool]


def graded(row: dict) -> Graded | None:
    """Return a row with its answer and verdict read; None if it was left out."""
    if "left_out" in row:
        return None
    background = tuple(tuple(item.split("@", 1)) for item in row["items"])
    plain = answer_from(tomllib.loads(row["answer"]), "answer")
    truth = Truth(plain.causes, plain.mistuned, plain.machine, plain.tags, background)
    try:
        verdict = verdict_from(row.get("verdict"))
    except TruthError:
        verdict = NOTHING_SAID
    return Graded(row, truth, verdict)


def figures(rows: Sequence[dict], old: Sequence[dict] = ()) -> list[dict[str, object]]:
    """Return the figures of rows, and how another engine differs on the same campaigns."""
    read = [case for row in rows if (case := graded(row)) is not None]
    cells: dict[str, list[Graded]] = {}
    for case in sorted(read, key=lambda case: (case.row["cell"], case.cell)):
        cells.setdefault(case.cell, []).append(case)
    found: list[dict[str, object]] = []
    for cell, here in cells.items():
        found += _of_cell(cell, here)
    for ratio in (4, 2):
        parts = [cells.get(f"dirt {dirt} %, ratio {ratio}", []) for dirt in POOLED_DIRT]
        if pooled := list(chain(*parts)):
            found += _of_one_fault(f"dirt 5 and 15 % together, ratio {ratio}", pooled)
    left_out = [row["left_out"] for row in rows if "left_out" in row]
    for reason in sorted(set(left_out)):
        found.append(_figure(f"campaigns left out: {reason}", left_out.count(reason), len(rows)))
    failed = sum(case.verdict is NOTHING_SAID for case in read)
    found.append(_figure("diagnoses that ended in an error", failed, len(read)))
    found += _calibration(read)
    found += _time("all", read)
    return found + compared(rows, old)


def _of_cell(cell: str, here: list[Graded]) -> list[dict[str, object]]:
    """Return the figures that the cell is asked for, and its time."""
    kind = here[0].row["cell"]
    rate = partial(_rate, cell, here)
    found: list[dict[str, object]] = []
    if kind in ("single", "clean"):
        found += _of_one_fault(cell, here)
    elif kind == "several":
        found += [
            rate("all found", _has_all),
            *_by_dirt(cell, here, "all found", _has_all),
            rate("one of them first", lambda c: truth_is_first(c.truth, c.verdict)),
            _mean_probability(cell, here),
        ]
    elif kind == "nothing":
        found += [rate("false alarms", lambda c: c.verdict.verdict != "none")]
    elif kind == "force":
        for name, part in _force_groups(here).items():
            found.append(_rate(f"{cell}, {name}", part, "right", right_about_force))
    else:
        words = sorted({case.verdict.verdict for case in here})
        found += [rate(f"verdict {word}", partial(_says, word)) for word in words]
        found += _by_dirt(cell, here, "wrong cause with p of 0.5 or more", has_wrong_cause)
    found.append(rate("wrong cause with p of 0.5 or more", has_wrong_cause))
    return [*found, *_time(cell, here)]


def _of_one_fault(cell: str, here: list[Graded]) -> list[dict[str, object]]:
    """Return how often one fault is named first, and its mean probability."""
    rate = partial(_rate, cell, here)
    return [
        rate("effect and place first", lambda c: right_first(c.truth, c.verdict)),
        rate("the fault itself first", lambda c: truth_is_first(c.truth, c.verdict)),
        rate("verdict partly or explained", lambda c: c.verdict.verdict in SAID),
        _mean_probability(cell, here),
    ]


def _by_dirt(cell: str, here: list[Graded], what: str, mark: Mark) -> list[dict[str, object]]:
    """Return a rate of a cell for each amount of dirt in it."""
    amounts = sorted({case.row["dirt"] for case in here})
    parts = [(dirt, [case for case in here if case.row["dirt"] == dirt]) for dirt in amounts]
    return [_rate(f"{cell}, dirt {dirt:g} %", part, what, mark) for dirt, part in parts]


def _has_all(case: Graded) -> bool:
    return all_found(case.truth, case.verdict)


def _says(word: str, case: Graded) -> bool:
    return case.verdict.verdict == word


def has_wrong_cause(case: Graded) -> bool:
    """Tell whether a verdict says that a cause is there which is not."""
    return bool(wrong_causes(case.truth, case.verdict))


def _force_groups(here: list[Graded]) -> dict[str, list[Graded]]:
    groups: dict[str, list[Graded]] = {"gain 0.92 to 1.08": [], "gain beyond": [], "delay": []}
    for case in here:
        groups[_force_group(case)].append(case)
    return {name: part for name, part in groups.items() if part}


def _force_group(case: Graded) -> str:
    name, value = case.row["parameter"]
    if name == "delay":
        return "delay"
    return "gain beyond" if abs(value - 1) > GAIN_TO_BE_NAMED else "gain 0.92 to 1.08"


def right_about_force(case: Graded) -> bool:
    """Tell whether a verdict is right about the force channel.

    A gain within 8 % has to be named or nothing may be; a larger one has to be named, or a cause
    that the verdict calls its twin; a delay has to be named.
    """
    effect, (first, *_) = case.row["effects"][0], (*case.verdict.causes, None)
    named = first is not None and first.effect == effect
    group = _force_group(case)
    if group == "gain 0.92 to 1.08":
        says_nothing = case.verdict.verdict == "none" or bool(case.row["dirt"])
        return named or (says_nothing and not has_wrong_cause(case))
    is_twin = first is not None and any(
        (first.effect, first.location) in twins and any(twin == effect for twin, _ in twins)
        for twins in case.verdict.twins
    )
    return named or (group == "gain beyond" and is_twin)


def _calibration(read: Iterable[Graded]) -> list[dict[str, object]]:
    """Return how often causes are right that were stated with so much probability."""
    stated = [
        (row.probability, is_right(case.truth, case.verdict, row))
        for case in read
        for row in case.verdict.causes
    ]
    return [
        _figure(
            f"right of causes stated {part.low:g} to {part.high:g}, mean {part.stated:.3f}, %",
            100 * part.true.rate,
            _with_interval(part.true.hits, part.true.n),
        )
        for part in diagram_of(stated).bins
        if part.stated is not None and part.true.rate is not None
    ]


def compared(rows: Sequence[dict], old: Sequence[dict]) -> list[dict[str, object]]:
    """Return the difference of two engines on the exact machines that both have diagnosed."""
    found: list[dict[str, object]] = []
    for cell in ("clean", "nothing"):
        marks = [
            {
                case.row["seed"]: right_alone(case)
                for row in each
                if row["cell"] == cell and (case := graded(row)) is not None
            }
            for each in (rows, old)
        ]
        both = sorted(marks[0].keys() & marks[1].keys())
        if both:
            pair = paired_difference((marks[0][seed], marks[1][seed]) for seed in both)
            name = (
                f"{cell}: right, this engine less the old one, % (alone right {pair.first_alone} "
                f"and {pair.second_alone}, McNemar's p {pair.p_value:.2f})"
            )
            interval = f"{pair.n} [{100 * pair.low:.1f}, {100 * pair.high:.1f}]"
            found.append(_figure(name, 100 * pair.difference, interval))
    return found


def right_alone(case: Graded) -> bool:
    """Tell whether a verdict on an exact machine is right: the one fault likely, or none."""
    if not case.truth.causes:
        return case.verdict.verdict == "none"
    return all_found(case.truth, case.verdict) and not has_wrong_cause(case)


def wrong_rows(rows: Sequence[dict]) -> list[tuple[int, str, str]]:
    """Return seed, truth and what was said of every row whose verdict is wrong."""
    found = []
    for case in (graded(row) for row in rows):
        if case is not None and not is_right_row(case):
            true = ", ".join(f"{c.effect} at {c.location}" for c in case.truth.causes) or "nothing"
            causes = [
                f"{c.effect} at {c.location} {c.probability:.2f}" for c in case.verdict.causes
            ]
            said = ", ".join([case.verdict.verdict, *causes[:2]])
            found.append((case.row["seed"], f"{case.cell}: {true}", said))
    return found


def is_right_row(case: Graded) -> bool:
    """Tell whether the verdict of a row is right, by what its cell asks for."""
    kind = case.row["cell"]
    if case.verdict is NOTHING_SAID:
        return False
    if kind == "single":
        return right_first(case.truth, case.verdict)
    if kind == "several":
        return all_found(case.truth, case.verdict)
    if kind == "force":
        return right_about_force(case)
    return right_alone(case) if kind in ("clean", "nothing") else not has_wrong_cause(case)


def _rate(cell: str, here: list[Graded], what: str, mark: Mark) -> dict[str, object]:
    hits = sum(map(mark, here))
    return _figure(f"{cell}: {what}, %", 100 * hits / len(here), _with_interval(hits, len(here)))


def _mean_probability(cell: str, here: list[Graded]) -> dict[str, object]:
    mean = fmean(probability_on(case.truth, case.verdict) for case in here)
    return _figure(f"{cell}: probability of the truth, mean", mean, len(here))


def _time(cell: str, here: list[Graded]) -> list[dict[str, object]]:
    seconds = [case.row["seconds"] for case in here]
    if not seconds:
        return []
    return [
        _figure(f"{cell}: core seconds, median", median(seconds), len(seconds)),
        _figure(f"{cell}: core seconds, largest", max(seconds), len(seconds)),
    ]


def _with_interval(hits: float, n: int) -> str:
    low, high = wilson(hits, n)
    return f"{n} [{100 * low:.1f}, {100 * high:.1f}]"


def _figure(name: str, value: float, n: object) -> dict[str, object]:
    return {"figure": name, "value": value, "n": n}
