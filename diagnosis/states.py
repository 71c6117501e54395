"""Tests after a change of a machine, against the machine before it.

1. The tests before are fitted alone, as a null model is.
2. What the model lacks before is held as dynamic stiffness, where these tests give a full matrix
   (``tuning.assessment.rest_estimate``). Otherwise its causes are sought in the tests before, and
   are part of the machine: they are no change. The floor of that fit stands in for the rest.
3. The tests after meet that machine. Masses and geometry stay. What differs between two visits of
   itself varies under priors: the temperature, and all that is mounted or hit anew.

If the states are two machines of one drawing, all parameters differ independently: the difference
of two draws has sqrt(2) times the width of one. The rest belongs to the drawing.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from diagnosis.between_visits import (
    VISIT_PRIORS,
    calibrate_nominally,
    vary_between_machines,
    vary_between_visits,
)
from diagnosis.data_checks.check_data import CheckedData, check_tests
from diagnosis.null_model import Baseline
from diagnosis.search.selection import select_causes
from diagnosis.settings import DiagnosisSettings
from identification.words import Campaign, Dof
from mbmodel import HammerGainPart, Model, RestPart
from tuning import Session, parametrise
from tuning.assessment.rest_estimate import (
    add_variance,
    estimate_rest,
    find_known_lines,
    shrink_rest,
)

_NO_MATRIX = (
    "no full matrix of FRFs before the change: what the model lacks, beside causes that the tests "
    "before show, counts as its error"
)
_TWO_MACHINES = (
    "both states are machines of one drawing: each parameter may differ by sqrt(2) times its "
    "tolerance"
)


def search_before(
    before: Baseline, settings: DiagnosisSettings, say: Callable[[str], None]
) -> Baseline:
    """Return the fit of the tests before with the causes of their gap, if no matrix holds the gap.

    Args:
        before: fit of the tests before.
        say: called with the current step.
    """
    scene = before.scene
    if estimate_rest(scene.session.model, scene.theta, scene.session.campaign) is not None:
        return before
    refit = select_causes(before, settings, say).selected
    scene = replace(scene, session=refit.session, theta=refit.fit.theta)
    return replace(before, scene=scene, null=refit)


def check_data_after(
    session: Session, before: Baseline, settings: DiagnosisSettings
) -> CheckedData:
    """Return the tests after the change, with the machine before it as the nominal model.

    Args:
        session: the whole campaign, and the drawing.
        before: fit of the tests before.
    """
    fitted, theta = before.null.session, before.scene.theta
    checks, unsteady = check_tests(
        replace(session, campaign=session.campaign.select_state("after")),
        settings,
        before.scene.session.campaign,
    )
    model, remark = fitted.model, _NO_MATRIX
    alive, left = checks.alive, checks.campaign
    estimate = estimate_rest(fitted.model, theta, before.scene.session.campaign)
    if estimate is not None:
        tolerance = session.campaign.tolerance
        if before.null.floor > min(tolerance.sensor_gain, tolerance.hammer_gain):
            theta = calibrate_nominally(before.null.fit.parametrisation, theta)
            estimate = estimate_rest(fitted.model, theta, before.scene.session.campaign) or estimate
        rest, carried = shrink_rest(
            estimate, checks.alive, before.null.floor, _rest_drift(session.campaign)
        )
        rest = replace(
            rest, scale_deviation=float(np.hypot(tolerance.hammer_gain, tolerance.sensor_gain))
        )
        machine = replace(model.machine, rest=rest)
        model = Model(machine, (*model.parts, RestPart(), *_hit_gains(checks.alive)))
        alive, left = (
            add_variance(campaign, estimate, carried).select_lines(
                find_known_lines(campaign, estimate, carried)
            )
            for campaign in (alive, left)
        )
        count = len(estimate.rest.outputs)
        remark = (
            f"what the model lacked before the change is known at {count} points and directions"
        )
    remarks = [remark, *([_TWO_MACHINES] if session.campaign.has_two_machines else [])]
    alive, left = (
        replace(campaign, remarks=(*campaign.remarks, *remarks)) for campaign in (alive, left)
    )
    varies = fitted.parametrisation.extend(parametrise(model, session.campaign.tolerance))
    theta = np.append(theta, model.drawn[len(theta) :])
    if session.campaign.has_two_machines:
        parametrisation = vary_between_machines(varies, theta)
    else:
        parametrisation = vary_between_visits(varies, theta)
    after = replace(fitted, model=model, campaign=alive, parametrisation=parametrisation)
    checks = replace(checks, alive=alive, campaign=left)
    return CheckedData(after, checks, before.scene.rigid_directions, unsteady)


def _rest_drift(campaign: Campaign) -> float:
    """Return the standard deviation of ln of the factor on the dynamic stiffness of the rest.

    What a drawing lacks, such as the modes of its bodies, differs between two machines as their
    masses do: both follow from how well the drawing is made.

    Args:
        campaign: tests of both states.
    """
    if campaign.has_two_machines:
        return float(np.sqrt(2)) * campaign.tolerance.mass  # of two independent draws
    return VISIT_PRIORS.stiffness


def _hit_gains(campaign: Campaign) -> tuple[HammerGainPart, ...]:
    """Return the gain of the hits at each reference: no two averages are the same to 0.1 %.

    Args:
        campaign: tests after the change.
    """
    hits = {
        (test.condition.instrument, test.condition.reference.positive): None
        for test in campaign.tests
        if isinstance(test.condition.reference, Dof)
    }
    return tuple(HammerGainPart(name, "hammer_gain", reference) for name, reference in hits)
