"""Content of verdict.json from a diagnosis.

Gains that the campaign declares unknown, as the verdict states them.
"""

from diagnosis.algorithm import Diagnosis
from diagnosis.data_checks.bending_bodies import RELEASED
from diagnosis.decision.remaining_gap import list_places
from diagnosis.effects import load_catalogue
from diagnosis.estimates.gap_by_level import find_closed_part
from diagnosis.estimates.held_out_gap import HeldOutGap, estimate_jackknife, estimate_size_jackknife
from diagnosis.inference.evidence import BENDS, Key
from diagnosis.levels.free_levels import LAW_EFFECTS, list_levels
from diagnosis.next_test.discriminating import propose_experiment
from diagnosis.scene_points import list_hidden_bodies
from diagnosis.verdict.schema import (
    CauseRow,
    GapSteps,
    Interval,
    Probability,
    Verdict,
)
from identification import MIN_REDUNDANT_CHANNELS
from mbmodel import HammerGainPart, HammerPart, SensorPart
from tuning import MIN_VISIBLE_EXCESS, channel_gaps, estimate_confidence, predict, summarise_gaps
from tuning.files.parameter_rows import channel_gain_rows
from tuning.files.schema import ChannelGainRow, GapRow

# Effects that only redundant channels of a body show.
_REDUNDANCY_EFFECTS = ("sensor_swap", BENDS)
# Tolerance of a sensor that each effect releases.
_SENSOR_TOLERANCES = {effect: tolerance for effect, (tolerance, _) in RELEASED.items()} | {
    "sensor_delay": "delay"
}


def build_verdict(diagnosis: Diagnosis) -> Verdict:
    """Return the content of verdict.json."""
    posterior, present, settings = diagnosis.posterior, diagnosis.present, diagnosis.settings
    retuned, after = diagnosis.retuned.gap, diagnosis.after
    is_visible = retuned.excess is not None and retuned.excess >= MIN_VISIBLE_EXCESS
    is_none = present.word == "none"
    if is_none:
        after = None
    levels, foretold = ([], None) if is_none else diagnosis.level_gaps
    return Verdict(
        verdict=present.word,
        probability=Probability.model_validate(posterior),
        gap=GapSteps(
            as_drawn=GapRow.model_validate(diagnosis.as_drawn),
            retuned=GapRow.model_validate(retuned),
            after=GapRow.model_validate(after.gap) if after else GapRow(error=None, excess=None),
            noise=retuned.noise,
            closed=find_closed_part(retuned, after.gap) if is_visible and after else None,
            interval=_find_interval(diagnosis.retuned, after, visible=is_visible),
            levels=levels,
            foretold=foretold,
        ),
        where=list_places(posterior.where, settings, is_known=not is_none),
        causes=[_build_row(key, probability, diagnosis) for key, probability in posterior.causes],
        rest=present.rest,
        twins=list(diagnosis.twins),
        not_testable=_list_untestable(diagnosis),
        next_experiment=propose_experiment(diagnosis),
        remarks=present.remarks,
        channel_gains=list_channel_gains(diagnosis),
    )


def estimate_step_intervals(diagnosis: Diagnosis) -> dict[str, tuple[float, float] | None]:
    """Return the 95 % intervals of the excess at each step of the gap, and of the noise.

    They are jackknife intervals over the folds of the blocks; None if there are no folds.

    Returns:
        Intervals of ``as_drawn``, ``retuned``, ``after`` and ``noise``.
    """
    session, levels = diagnosis.session, {"retuned": diagnosis.retuned, "after": diagnosis.after}
    held = diagnosis.retuned.held_out
    if held is None:
        return dict.fromkeys(("as_drawn", *levels, "noise"))
    kept = [held.folds != fold for fold in range(int(held.folds.max()) + 1)]
    drawn = predict(session.model, session.parametrisation.fixed, session.campaign)
    parts = [
        summarise_gaps(
            channel_gaps([values[lines] for values in drawn], session.campaign.select_lines(lines))
        )
        for lines in kept
    ]
    ends = {
        "as_drawn": estimate_size_jackknife(
            diagnosis.as_drawn.excess, [values.excess for values in parts]
        ),
        "noise": estimate_size_jackknife(
            diagnosis.retuned.gap.noise, [values.noise for values in parts]
        ),
    }
    for name, level in levels.items():
        if level is not None:
            gaps = [level.select_lines(lines).excess for lines in kept]
            ends[name] = estimate_size_jackknife(level.gap.excess, gaps)
    return {name: ends.get(name) for name in ("as_drawn", *levels, "noise")}


def _find_interval(retuned: HeldOutGap, after: HeldOutGap | None, *, visible: bool) -> Interval:
    """Return the jackknife intervals over the folds of the blocks."""
    if after is None or after.held_out is None:
        return Interval()
    folds = after.held_out.folds
    kept = [folds != fold for fold in range(int(folds.max()) + 1)]
    gaps = [(retuned.select_lines(lines), after.select_lines(lines)) for lines in kept]
    return Interval(
        closed=estimate_jackknife(
            find_closed_part(retuned.gap, after.gap), [find_closed_part(*pair) for pair in gaps]
        )
        if visible
        else None,
        after=estimate_size_jackknife(after.gap.excess, [pair[1].excess for pair in gaps]),
    )


def _build_row(key: Key, probability: float, diagnosis: Diagnosis) -> CauseRow:
    """Return the row of a cause by its best refit, with intervals if the cause is present."""
    effect, location, dof = key
    refits = sorted(diagnosis.search.refits, key=lambda refit: refit.objective)
    fits = ((refit, cause) for refit in refits for cause in refit.causes if cause.key == key)
    refit, cause = next(fits, (None, None))
    row = CauseRow(
        effect=effect,
        location=location,
        dof=dof or (refit.find_direction(cause) if refit and cause else None),
        probability=min(1.0, probability),
        parameters=refit.state_parameters(cause) if refit and cause else {},
        interval={},
        excess_after=None,
        places=diagnosis.posterior.list_places(key),
        laws=list(entry.laws) if (entry := load_catalogue().get(effect)) else [],
    )
    present = next(
        (cause_present for cause_present in diagnosis.present.causes if cause_present.key == key),
        None,
    )
    if present is None:
        return row
    after, parameters = diagnosis.after, diagnosis.parameters
    if after is None or parameters is None:
        return (
            row if present.is_modelled else row.model_copy(update={"parameters": present.state({})})
        )
    update = {
        "parameters": parameters.state_parameters(present),
        "interval": diagnosis.present.intervals[key]
        if key in diagnosis.present.intervals
        else parameters.estimate_intervals(present),
        "excess_after": after.gap.excess,
    }
    return row.model_copy(update=update)


def _list_untestable(diagnosis: Diagnosis) -> list[str]:
    """Return the effects that this kind of data cannot show."""
    tests = diagnosis.session.campaign.tests
    levels = list_levels(diagnosis.session.campaign)
    catalogue = load_catalogue()
    missing = [effect for effect in LAW_EFFECTS if len(levels) < 2 or effect not in catalogue]
    references = {str(test.condition.reference) for test in tests}
    setups = {test.condition.setup for test in tests}
    if len(references) < 2 and len(setups) < 2 and len(levels) < 2:
        missing.append("drift")
    named = {effect for (effect, _, _), _ in diagnosis.posterior.causes}
    if any(check.redundant < MIN_REDUNDANT_CHANNELS for check in diagnosis.checks.bodies):
        missing += [effect for effect in _REDUNDANCY_EFFECTS if effect not in named]
    elif BENDS not in named and _has_bare_body(diagnosis):
        missing.append(BENDS)
    return missing + [effect for effect in _list_fixed_effects(diagnosis) if effect not in named]


def _list_fixed_effects(diagnosis: Diagnosis) -> list[str]:
    """Return the effects whose tolerances a user has fixed, unless redundant channels test them."""
    free = set(diagnosis.session.parametrisation.names)
    checked = {
        check.body for check in diagnosis.checks.bodies if check.redundant >= MIN_REDUNDANT_CHANNELS
    }
    effects: dict[str, None] = {}
    for part in diagnosis.session.model.parts:
        released: dict[str, str] = {}
        if isinstance(part, HammerPart):
            released = {"hammer_misalignment": "rotation_", "hammer_position": "position_"}
        elif isinstance(part, HammerGainPart):
            released = {"hammer_gain": "gain", "hammer_delay": "delay"}
        elif isinstance(part, SensorPart):
            body = diagnosis.session.campaign.layout.body_name(part.point.name)
            if body not in checked:
                released = {name: f"{tolerance}_" for name, tolerance in _SENSOR_TOLERANCES.items()}
        fixed = [parameter.name for parameter in part.parameters if parameter.name not in free]
        effects |= {
            name: None
            for name, tolerance in released.items()
            if any(f".{tolerance}" in parameter for parameter in fixed)
        }
    return list(effects)


def _has_bare_body(diagnosis: Diagnosis) -> bool:
    """Return whether neither data checks nor score tests tell whether some body bends."""
    tested = {check.body for check in diagnosis.checks.bodies}
    return set(diagnosis.session.campaign.layout.bodies) > {
        *tested,
        *list_hidden_bodies(diagnosis.scene),
    }


def list_channel_gains(diagnosis: Diagnosis) -> list[ChannelGainRow]:
    """Return the gains of the fit with the causes, or of the null model without causes."""
    nominal = diagnosis.session.campaign.unknown_gains.nominal
    if not nominal:
        return []
    if diagnosis.parameters is not None:
        theta, confidence = diagnosis.parameters.theta, diagnosis.parameters.confidence
    else:
        refit = diagnosis.null
        theta = refit.fit.theta
        confidence = estimate_confidence(refit.session.model, refit.session.campaign, refit.fit)
    return channel_gain_rows(nominal, confidence.parametrisation, theta, confidence.interval())
