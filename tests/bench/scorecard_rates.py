"""The grader of the scorecard: one row of figures a cell, with Wilson's intervals.

A row counts in the cell of the survival ratio that was drawn, the nearest of 2 and 4, which need
not be the one that was wanted. A verdict is right, by what its machine has,

* with one fault: if effect and place come first (beside dirt: or an established item of the dirt);
* with several faults: if all of them come first and are likely;
* with nothing: if it says so; with dirt or levels alone: if it names no wrong cause; with an effect
  outside the catalogue: if it says that something is missing, and names no wrong cause;
* with drift between levels or a wrong force channel: if it is named, or is a twin of what is named;
  a gain of the force within 8 % may also be passed over.

A *wrong cause* has a probability of 0.5 or more and is not there.
"""

import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from statistics import fmean, median

from tests.bench.beside_background import all_found, is_right, probability_on, right_first
from tests.bench.beside_background import wrong_causes as wrong_causes_of
from tests.bench.scorecard_draws import Design
from truth import TruthError
from truth.effects.outside import OUTSIDE
from truth.grade.answer import Truth, answer_from
from truth.grade.rates import Diagram, Rate, diagram_of, rate_of
from truth.grade.read_verdict import verdict_from
from truth.grade.sizes import Sizes, estimates_of, sizes_of
from truth.grade.verdict import NOTHING_SAID, StatedVerdict

BETWEEN_2_AND_4 = 8**0.5  # survival ratio: the geometric mean
GAIN_TO_BE_NAMED = 0.1  # |gain - 1| above it has to be named
POOLED = (  # label, first words of the cells
    ("beside 5 or 15 % of dirt, ratio 4", ("dirt 5 %, ratio 4", "dirt 15 %, ratio 4")),
    ("beside 5 or 15 % of dirt, ratio 2", ("dirt 5 %, ratio 2", "dirt 15 %, ratio 2")),
    ("nothing missing, all", ("nothing",)),
)


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
        """Row of the table that the campaign counts in."""
        cell, ratio = str(self.row["cell"]), self.row["drawn_ratio"]
        if not self.row["dirt"] or len(self.row["effects"]) != 1 or ratio is None:
            return cell
        return f"{cell}, ratio {4 if ratio >= BETWEEN_2_AND_4 else 2}"

    @cached_property
    def wrong_causes(self) -> int:
        """How many causes are said to be there and are not."""
        return len(wrong_causes_of(self.truth, self.verdict))

    @cached_property
    def is_right(self) -> bool:
        """Whether the verdict is right, by what its cell asks for."""
        effects, verdict = self.row["effects"], self.verdict
        if verdict is NOTHING_SAID:
            return False
        if not effects:
            is_exact = not self.row["dirt"] and len(self.row["levels"]) <= 1
            return verdict.verdict == "none" if is_exact else not self.wrong_causes
        if set(effects) <= set(OUTSIDE):
            return verdict.verdict != "none" and not self.wrong_causes
        if len(effects) > 1:
            return all_found(self.truth, verdict)
        return right_first(self.truth, verdict) or self._is_right_otherwise(effects[0])

    def _is_right_otherwise(self, effect: str) -> bool:
        """Tell whether a drift or a fault of the force channel is named otherwise."""
        if effect == "level_drift":
            return self._names_twin_of("drift")
        if not self.row["parameter"]:
            return False
        name, value = self.row["parameter"]
        if any(cause.effect == effect for cause in self.verdict.causes[:1]):
            return True
        if name == "gain" and abs(value - 1) <= GAIN_TO_BE_NAMED:
            says_nothing = self.verdict.verdict == "none" or bool(self.row["dirt"])
            return says_nothing and not self.wrong_causes
        return name == "gain" and self._names_twin_of(effect)

    def _names_twin_of(self, effect: str) -> bool:
        """Tell whether the verdict calls its first cause a twin of an effect."""
        return any(
            (first.effect, first.location) in twins and any(name == effect for name, _ in twins)
            for first in self.verdict.causes[:1]
            for twins in self.verdict.twins
        )


def graded(row: dict) -> Graded | None:
    """Return a row with its answer and verdict read; None if it was left out."""
    if "left_out" in row:
        return None
    row = asdict(Design("")) | row  # older rows state less
    background = tuple(tuple(item.split("@", 1)) for item in row["items"])
    plain = answer_from(tomllib.loads(row["answer"]), "answer")
    truth = Truth(plain.causes, plain.mistuned, plain.machine, plain.tags, background)
    try:
        verdict = verdict_from(row.get("verdict"))
    except TruthError:
        verdict = NOTHING_SAID
    return Graded(row, truth, verdict)


def read_rows(rows: Iterable[dict]) -> list[Graded]:
    """Return all rows that count, with their answers and verdicts read."""
    return [case for row in rows if (case := graded(row)) is not None]


def rate_rows(rows: Sequence[dict]) -> list[dict[str, object]]:
    """Return the figures of every cell, of cells together, and of all."""
    read = read_rows(rows)
    cells = sorted({case.cell for case in read})
    groups = [(cell, [case for case in read if case.cell == cell]) for cell in cells]
    groups += [
        (label, [case for case in read if case.cell.startswith(names)]) for label, names in POOLED
    ]
    groups.append(("random trees", [case for case in read if case.row["machine"] == "tree"]))
    groups.append(("all", read))
    return [rate_cell(label, group) for label, group in groups if group]


def rate_cell(label: str, here: Sequence[Graded]) -> dict[str, object]:
    """Return the figures of some campaigns: rates in per cent, numbers, core seconds."""
    wrong = rate_of(float(case.wrong_causes > 0) for case in here)
    held = sizes(here).intervals
    return {
        "cell": label,
        **_percent("right", rate_of(float(case.is_right) for case in here)),
        **_percent("wrong cause", wrong),
        "errors": sum(case.verdict is NOTHING_SAID for case in here),
        "probability": fmean(probability_on(case.truth, case.verdict) for case in here),
        **_percent("intervals", held),
        "core s": median(case.row["seconds"] for case in here),
        "core s max": max(case.row["seconds"] for case in here),
    }


def _percent(name: str, rate: Rate) -> dict[str, object]:
    low, high = (None, None) if rate.low is None or rate.high is None else (rate.low, rate.high)
    return {
        name: None if rate.rate is None else 100 * rate.rate,
        f"{name} from": None if low is None else 100 * low,
        f"{name} to": None if high is None else 100 * high,
        f"{name} n": rate.n,
    }


def sizes(here: Iterable[Graded]) -> Sizes:
    """Return errors of sizes, and how many intervals hold the truth."""
    return sizes_of(each for case in here for each in estimates_of(case.truth, case.verdict))


def stated_probabilities(here: Iterable[Graded]) -> Diagram:
    """Return how often causes are right that were stated with so much probability."""
    return diagram_of(
        (row.probability, is_right(case.truth, case.verdict, row))
        for case in here
        for row in case.verdict.causes
    )


def left_out(rows: Iterable[dict]) -> dict[str, int]:
    """Return how many campaigns were left out, by reason."""
    reasons = [str(row["left_out"]) for row in rows if "left_out" in row]
    return {reason: reasons.count(reason) for reason in sorted(set(reasons))}


def wrong_rows(
    rows: Iterable[dict], mark: Callable[[Graded], bool] = lambda case: not case.is_right
) -> list[tuple[int, str, str]]:
    """Return seed, truth and what was said of every row whose verdict is wrong."""
    wrong = []
    for case in filter(mark, read_rows(rows)):
        true = ", ".join(f"{c.effect} at {c.location}" for c in case.truth.causes) or "nothing"
        causes = [f"{c.effect} at {c.location} {c.probability:.2f}" for c in case.verdict.causes]
        said = ", ".join([case.verdict.verdict, *causes[:2]])
        wrong.append((case.row["seed"], f"{case.cell}: {true}", said))
    return wrong
