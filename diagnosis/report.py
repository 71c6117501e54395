"""A diagnosis as the verdict's file."""

import numpy as np

from diagnosis.diagnose import Diagnosis, Level
from diagnosis.effects import EFFECTS
from diagnosis.judge import Cause
from diagnosis.verdict import (
    CauseRow,
    GapAt,
    GapSteps,
    Interval,
    Probability,
    Verdict,
    Where,
    Word,
)
from tuning import Gap

_HIDDEN = 1.1  # excess below which no share and no closing exists
_NONLINEAR = ("friction", "backlash", "hardening")
_SMALLEST = 0.005  # share of a place that is worth a row


def verdict_of(found: Diagnosis) -> Verdict:
    """The content of verdict.json."""
    judged = found.judged
    word: Word = judged.word  # type: ignore[assignment]
    retuned = found.retuned.gap
    visible = retuned.excess is not None and retuned.excess >= _HIDDEN
    after = found.after if word != "none" else None
    return Verdict(
        verdict=word,
        probability=Probability(
            none=judged.none, unexplained=judged.unexplained, several=judged.several
        ),
        gap=GapSteps(
            as_drawn=_at(found.as_drawn),
            retuned=_at(retuned),
            after=_at(after.gap) if after else GapAt(error=None, excess=None),
            noise=retuned.noise,
            closed=_closed(retuned, after) if visible else None,
            interval=Interval(),
        ),
        where=[
            Where(location=place, share=share if visible else None)
            for place, share in judged.where
            if share >= _SMALLEST
        ],
        causes=[_row(cause, found) for cause in judged.causes],
        twins=_twins(found),
        not_testable=_not_testable(found),
        next_experiment=None,
    )


def _at(gap: Gap) -> GapAt:
    return GapAt(error=gap.error, excess=gap.excess)


def _closed(retuned: Gap, after: Level | None) -> float | None:
    if after is None or after.gap.excess is None or retuned.excess is None:
        return None
    return float((retuned.excess**2 - after.gap.excess**2) / (retuned.excess**2 - 1))


def _row(cause: Cause, found: Diagnosis) -> CauseRow:
    one = cause.hypothesis
    parameters = {} if cause.refit is None else cause.refit.parameters()
    excess = None if cause.refit is None else float(np.sqrt(cause.refit.chi_square))
    if one is found.judged.best and found.after is not None:
        at = found.after.fit
        names = (parameter.name for parameter in at.freedom.parameters)
        parameters = one.state(dict(zip(names, at.theta.tolist(), strict=True)))
        excess = found.after.gap.excess
    return CauseRow(
        effect=one.effect,
        location=one.location,
        dof=one.dof,
        probability=cause.probability,
        parameters=parameters,
        interval={},
        excess_after=excess,
    )


def _twins(found: Diagnosis) -> list[tuple[str, str]]:
    """Pairs of causes, both of some probability, that leave the same."""
    rows = [cause for cause in found.judged.causes if cause.probability >= 0.05 and cause.refit]
    names = [f"{cause.hypothesis.effect}@{cause.hypothesis.location}" for cause in rows]
    return [(a, b) for k, a in enumerate(names) for b in names[k + 1 :]]


def _not_testable(found: Diagnosis) -> list[str]:
    """What this kind of data cannot show."""
    tests = found.session.campaign.tests
    levels = {test.condition.level_n for test in tests}
    missing = list(_NONLINEAR) if len(levels) < 2 else []
    references = {str(test.condition.reference) for test in tests}
    setups = {test.condition.setup for test in tests}
    if len(references) < 2 and len(setups) < 2 and "drift" in EFFECTS:
        missing.append("drift")
    return missing
