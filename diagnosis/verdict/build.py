"""A diagnosis as the verdict's file."""

import numpy as np
from scipy.stats import t as student

from diagnosis.algorithm import Diagnosis
from diagnosis.data_checks.sensors import RELEASED
from diagnosis.effects import catalogue
from diagnosis.estimates.held_out_gap import HeldOutGap
from diagnosis.inference.evidence import BENDS, Key
from diagnosis.next_test.discriminating import next_experiment
from diagnosis.verdict.gains import list_channel_gains
from diagnosis.verdict.schema import (
    CauseRow,
    GapAt,
    GapSteps,
    Interval,
    Probability,
    Verdict,
    Where,
    Word,
)
from identification.words import Real
from mbmodel import HammerGainPart, HammerPart, SensorPart
from tuning import Gap, channel_gaps, predict, summarise_gaps

_HIDDEN = 1.1  # excess below which no share and no closing exists
NONLINEAR = ("friction", "backlash", "hardening")
# What the spare channels of a body alone can show, and how many that needs.
_OF_SPARE = ("sensor_swap", "mount_resonance", BENDS)
_SPARE = 2
# Tolerance of a sensor that each effect releases.
_OF_SENSORS = {name: of for name, (of, _) in RELEASED.items()} | {"sensor_delay": "delay"}
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
            closed=_closed(retuned, after.gap) if visible and after else None,
            interval=_interval(found.retuned, after, visible=visible),
        ),
        where=[
            Where(location=place, share=share if visible else None)
            for place, share in judged.where
            if share >= _SMALLEST
        ],
        causes=[_row(key, probability, found) for key, probability in judged.causes],
        twins=list(found.twins),
        not_testable=_not_testable(found),
        next_experiment=next_experiment(found),
        channel_gains=list_channel_gains(found),
    )


def _at(gap: Gap) -> GapAt:
    return GapAt(error=gap.error, excess=gap.excess)


def _closed(retuned: Gap, after: Gap) -> float | None:
    if after.excess is None or retuned.excess is None or retuned.excess <= 1:
        return None
    return float((retuned.excess**2 - after.excess**2) / (retuned.excess**2 - 1))


def step_intervals(found: Diagnosis) -> dict[str, tuple[float, float] | None]:
    """95 % intervals of what the gap's steps are: of excess, of the noise of error.

    By leaving one fold of the blocks out, as in the verdict; None where no fold can be left out.

    Args:
        found: the diagnosis.

    Returns:
        Of ``as_drawn``, ``retuned``, ``after`` and ``noise``.
    """
    session, levels = found.session, {"retuned": found.retuned, "after": found.after}
    held = found.retuned.held_out
    if held is None:
        return dict.fromkeys(("as_drawn", *levels, "noise"))
    kept = [held.folds != fold for fold in range(int(held.folds.max()) + 1)]
    drawn = predict(session.model, session.model.drawn, session.campaign)
    parts = [
        summarise_gaps(
            channel_gaps([one[lines] for one in drawn], session.campaign.select_lines(lines))
        )
        for lines in kept
    ]
    ends = {
        "as_drawn": _spread_of_sizes(found.as_drawn.excess, [one.excess for one in parts]),
        "noise": _spread_of_sizes(found.retuned.gap.noise, [one.noise for one in parts]),
    }
    for name, level in levels.items():
        if level is not None:
            gaps = [level.on(lines).excess for lines in kept]
            ends[name] = _spread_of_sizes(level.gap.excess, gaps)
    return {name: ends.get(name) for name in ("as_drawn", *levels, "noise")}


def _interval(retuned: HeldOutGap, after: HeldOutGap | None, *, visible: bool) -> Interval:
    """By leaving one fold of the blocks out (delete-group jackknife, Student with its folds)."""
    if after is None or after.held_out is None:
        return Interval()
    folds = after.held_out.folds
    kept = [folds != fold for fold in range(int(folds.max()) + 1)]
    gaps = [(retuned.on(lines), after.on(lines)) for lines in kept]
    return Interval(
        closed=_spread(_closed(retuned.gap, after.gap), [_closed(*one) for one in gaps])
        if visible
        else None,
        after=_spread_of_sizes(after.gap.excess, [one[1].excess for one in gaps]),
    )


def _spread(whole: float | None, without: list[float | None]) -> tuple[float, float] | None:
    values: Real = np.array([one for one in without if one is not None])
    count = len(without)
    if whole is None or count < 2 or len(values) < count:
        return None
    deviation = np.sqrt((count - 1) / count * ((values - values.mean()) ** 2).sum())
    half = float(student.ppf(0.975, count - 1) * deviation)
    return whole - half, whole + half


def _spread_of_sizes(
    whole: float | None, without: list[float | None]
) -> tuple[float, float] | None:
    """The same of what is never below zero, by its logarithm."""
    if not whole or not all(without):
        return None
    found = _spread(
        float(np.log(whole)), [None if one is None else float(np.log(one)) for one in without]
    )
    return None if found is None else (float(np.exp(found[0])), float(np.exp(found[1])))


def _row(key: Key, probability: float, found: Diagnosis) -> CauseRow:
    effect, location, dof = key
    fitted = {
        one.key: (made, one)
        for made in (*found.search.pairs[::-1], *found.search.refits)
        if made.hypothesis is not None
        for one in made.hypothesis.members or (made.hypothesis,)
    }
    made, tried = fitted.get(key, (None, None))
    row = CauseRow(
        effect=effect,
        location=location,
        dof=dof or (made.along(tried) if made and tried else None),
        probability=probability,
        parameters=made.stated(tried, made.fit.theta) if made and tried else {},
        interval={},
        excess_after=None,
    )
    one = next((one for one in found.present if one.key == key), None)
    if one is None:
        return row
    after = found.after
    if after is None or found.known is None:
        return row if one.is_held else row.model_copy(update={"parameters": one.state({})})
    update = {
        "parameters": found.known.stated(one),
        "interval": found.known.intervals(one),
        "excess_after": after.gap.excess,
    }
    return row.model_copy(update=update)


def _not_testable(found: Diagnosis) -> list[str]:
    """What this kind of data cannot show."""
    tests = found.session.campaign.tests
    levels = {test.condition.level_n for test in tests}
    missing = [one for one in NONLINEAR if len(levels) < 2 or one not in catalogue()]
    references = {str(test.condition.reference) for test in tests}
    setups = {test.condition.setup for test in tests}
    if len(references) < 2 and len(setups) < 2:
        missing.append("drift")
    named = {effect for (effect, _, _), _ in found.judged.causes}
    if any(check.redundant < _SPARE for check in found.gate.checks):
        missing += [effect for effect in _OF_SPARE if effect not in named]
    elif BENDS not in named and _bare(found):
        missing.append(BENDS)
    return missing + [effect for effect in _kept(found) if effect not in named]


def _kept(found: Diagnosis) -> list[str]:
    """Effects that release a tolerance which a user keeps as drawn, where no gate asks for them."""
    free = set(found.session.parametrisation.names)
    spared = {check.body for check in found.gate.checks if check.redundant >= _SPARE}
    kept: dict[str, None] = {}
    for part in found.session.model.parts:
        ours: dict[str, str] = {}
        if isinstance(part, HammerPart):
            ours = {"hammer_misalignment": "rotation_", "hammer_position": "position_"}
        elif isinstance(part, HammerGainPart):
            ours = {"hammer_gain": "gain", "hammer_delay": "delay"}
        elif isinstance(part, SensorPart):
            body = found.session.campaign.layout.body_name(part.point.name)
            ours = {} if body in spared else {name: f"{of}_" for name, of in _OF_SENSORS.items()}
        fixed = [one.name for one in part.parameters if one.name not in free]
        kept |= {name: None for name, of in ours.items() if any(f".{of}" in x for x in fixed)}
    return list(kept)


def _bare(found: Diagnosis) -> bool:
    """Whether a body carries no sensor, which the gate has nothing to say of."""
    return set(found.session.campaign.layout.bodies) > {one.body for one in found.gate.checks}
