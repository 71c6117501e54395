"""Grade a verdict on a machine that has small imperfections beside its causes.

Nothing is exact, so that a verdict may name what is small and true. An item of the background that
has the right effect and place and is *established* counts as right. A cause is established if its
probability is at least 0.5 and it closes at least a fifth of the gap,

    (retuned^2 - after^2) / (retuned^2 - 1) >= 0.2,

with the held-out excess of the re-tuned model and of the model with the cause, which for the first
cause is that of the verdict where its row does not state it.
"""

from truth.grade.answer import Truth
from truth.grade.marks import is_present
from truth.grade.verdict import Row, StatedVerdict

LIKELY = 0.5  # probability from which a cause is said to be there
CLOSED_SHARE = 0.2  # of retuned^2 - 1, from which a cause matters


def is_established(verdict: StatedVerdict, row: Row) -> bool:
    """Tell whether a cause is likely and matters."""
    after = row.excess_after
    if after is None and row in verdict.causes[:1]:
        after = verdict.after
    if row.probability < LIKELY or verdict.retuned is None or after is None:
        return False
    gap = verdict.retuned**2 - 1
    return gap > 0 and verdict.retuned**2 - after**2 >= CLOSED_SHARE * gap


def is_right(truth: Truth, verdict: StatedVerdict, row: Row) -> bool:
    """Tell whether a machine has a cause, among its faults or as an established item."""
    is_item = any(row.is_at(effect, location) for effect, location in truth.background)
    return is_present(truth, row) or (is_item and is_established(verdict, row))


def truth_is_first(truth: Truth, verdict: StatedVerdict) -> bool:
    """Tell whether the most probable cause is one of the machine's faults."""
    return any(is_present(truth, row) for row in verdict.causes[:1])


def right_first(truth: Truth, verdict: StatedVerdict) -> bool:
    """Tell whether the most probable cause is right."""
    return any(is_right(truth, verdict, row) for row in verdict.causes[:1])


def all_found(truth: Truth, verdict: StatedVerdict) -> bool:
    """Tell whether every fault is among as many of the first causes, and likely."""
    first = verdict.causes[: len(truth.causes)]
    named = [row for row in first if row.probability >= LIKELY]
    return len(named) == len(truth.causes) and all(
        any(row.is_at(cause.effect, cause.location) for row in named) for cause in truth.causes
    )


def wrong_causes(truth: Truth, verdict: StatedVerdict) -> tuple[Row, ...]:
    """Return the causes that are said to be there and are not right."""
    likely = (row for row in verdict.causes if row.probability >= LIKELY)
    return tuple(row for row in likely if not is_right(truth, verdict, row))


def probability_on(truth: Truth, verdict: StatedVerdict) -> float:
    """Return the probability that the faults are present, of several the least likely one's.

    Without faults it is that of none.
    """
    if not truth.causes:
        return verdict.none
    return min(
        sum(row.probability for row in verdict.causes if row.is_at(cause.effect, cause.location))
        for cause in truth.causes
    )
