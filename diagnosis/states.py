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
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.data_checks.check_data import CheckedData, check_tests
from diagnosis.null_model import Baseline
from diagnosis.search.selection import select_causes
from diagnosis.settings import DiagnosisSettings
from identification.words import TOLERANCE_BOUND_SIGMA, Campaign, Dof, Real
from mbmodel import REST_FACTOR, HammerGainPart, Model, RestPart
from tuning import Parametrisation, Session, parametrise
from tuning.assessment.rest_estimate import (
    add_variance,
    estimate_rest,
    find_known_lines,
    shrink_rest,
)


@dataclass(frozen=True)
class VisitPriors:
    """Standard deviations of what differs between two visits to one machine, without any change.

    Args:
        stiffness: of ln of the common factor on all stiffness. The moduli of steel and aluminium
            fall by 0.03 to 0.05 % per kelvin, so this is a difference of 10 to 17 K.
        damping: of ln of the common factor on all damping: losses of joints and cables repeat to
            some per cent from day to day.
        gain: of ln of each gain: calibration, mounting and cable of one and the same instrument.
        delay: of each delay [s]: start of sampling and filters of one and the same instrument.
    """

    stiffness: float = 0.005
    damping: float = 0.05
    gain: float = 0.005
    delay: float = 1e-5


VISIT_PRIORS = VisitPriors()
_TWO_DRAWS = float(
    np.sqrt(2.0)
)  # width of the difference of two independent draws over that of one
_NO_MATRIX = (
    "no full matrix of FRFs before the change: what the model lacks, beside causes that the tests "
    "before show, counts as its error"
)
_TWO_MACHINES = (
    "both states are machines of one drawing: each parameter may differ by sqrt(2) times its "
    "tolerance"
)
_REMOUNTED = {  # of a test: what is mounted, hit or switched on anew, and its prior
    "sensor_gain": "gain",
    "hammer_gain": "gain",
    "unknown_gain": "gain",
    "sensor_delay": "delay",
    "hammer_delay": "delay",
}
_PLACED = (  # anew, so that the campaign's tolerances hold
    "sensor_angle",
    "sensor_position",
    "sensor_cross",
    "hammer_angle",
    "hammer_position",
)


def search_before(
    before: Baseline, settings: DiagnosisSettings, say: Callable[[str], None]
) -> Baseline:
    """Return the fit of the tests before with the causes of their gap, if no matrix holds the gap.

    Args:
        before: fit of the tests before.
        settings: thresholds.
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
        settings: thresholds.
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
            theta = _calibrate_nominally(before.null.fit.parametrisation, theta)
            estimate = estimate_rest(fitted.model, theta, before.scene.session.campaign) or estimate
        rest, variance = shrink_rest(
            estimate, checks.alive, before.null.floor, _rest_drift(session.campaign)
        )
        rest = replace(
            rest, scale_deviation=float(np.hypot(tolerance.hammer_gain, tolerance.sensor_gain))
        )
        machine = replace(model.machine, rest=rest)
        model = Model(machine, (*model.parts, RestPart(), *_hit_gains(checks.alive)))
        alive, left = (
            add_variance(campaign, estimate, variance).select_lines(
                find_known_lines(campaign, estimate, variance)
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
        return _TWO_DRAWS * campaign.tolerance.mass
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


def _calibrate_nominally(varies: Parametrisation, theta: Real) -> Real:
    """Return parameters with instruments as they are stated.

    A model whose error exceeds the tolerance of gains tells nothing of them: its fit pulls
    instruments to make up for what it lacks. The rest holds that, whatever the instruments are:
    with their nominal calibration, sizes of changes are as right as that is.

    Args:
        varies: coordinates of the fit before; a parameter that a cause released is no tolerance.
        theta: its parameters [SI]; (n_parameter,).
    """
    tolerances = np.append(varies.is_tolerance, False)[varies.coordinate_of]
    kinds = {*_REMOUNTED, *_PLACED} - {"unknown_gain"}
    of_instruments = np.array([parameter.known in kinds for parameter in varies.parameters])
    return np.where(tolerances & of_instruments, varies.fixed, theta)


def vary_between_visits(
    varies: Parametrisation, theta: Real, priors: VisitPriors = VISIT_PRIORS
) -> Parametrisation:
    """Return the coordinates of what differs between two visits of itself.

    Args:
        varies: coordinates of the fit before; what does not vary there stays.
        theta: its parameters, which become the nominal ones [SI]; (n_parameter,).
        priors: standard deviations.
    """
    coordinate_of, scale = np.full(len(theta), -1), np.ones(len(theta))
    numbers: dict[object, int] = {}
    for k, parameter in enumerate(varies.parameters):
        old, kind = int(varies.coordinate_of[k]), parameter.known
        group: object = old
        if kind in ("stiffness", "damping"):
            group, deviation = kind, getattr(priors, kind)
        elif kind in _REMOUNTED:
            deviation = getattr(priors, _REMOUNTED[kind])
            if not parameter.positive and _REMOUNTED[kind] == "gain":
                deviation *= abs(theta[k])
        else:
            deviation = np.inf
        is_varied = kind in ("stiffness", "damping", *_REMOUNTED, *_PLACED)
        if parameter.name == REST_FACTOR:
            group, deviation, old, is_varied = "stiffness", priors.stiffness, 0, True
        is_narrow = varies.is_tolerance[old] and varies.scale[k] < deviation and group == old
        # A place that a cause of the state before released has no tolerance, and stays.
        if old < 0 or not is_varied or not (is_narrow or np.isfinite(deviation)):
            continue
        coordinate_of[k] = numbers.setdefault(group, len(numbers))
        scale[k] = varies.scale[k] if is_narrow else deviation
    size, bound = len(numbers), np.full(len(numbers), TOLERANCE_BOUND_SIGMA)
    return Parametrisation(
        varies.parameters,
        coordinate_of=coordinate_of,
        scale=scale,
        fixed=theta,
        is_tolerance=np.ones(size, bool),
        precision=np.ones(size),
        lower=-bound,
        upper=bound,
    )


def vary_between_machines(varies: Parametrisation, theta: Real) -> Parametrisation:
    """Return the coordinates of what differs between two machines of one drawing.

    Each coordinate of the fit before varies about its fitted value, with sqrt(2) times its width.

    Args:
        varies: coordinates of the fit before; what does not vary there stays, and so do causes.
        theta: its parameters, which become the nominal ones [SI]; (n_parameter,).
    """
    kinds = np.array([parameter.known for parameter in varies.parameters])
    place, is_tolerance = varies.coordinate_of, varies.is_tolerance
    # A cause released its parameters: they have neither prior nor width, and stay.
    kept = varies.precision > 0
    kept[place[varies.free & np.isin(kinds, ("stiffness", "damping"))]] = True
    widths = np.where(np.append(is_tolerance, False)[place], _TWO_DRAWS, 1.0)
    undrawn = np.flatnonzero(varies.free & (kinds == "undrawn_damping"))  # never negative
    lower = varies.lower.copy()
    lower[place[undrawn]] = -theta[undrawn] / varies.scale[undrawn]
    about = replace(
        varies,
        scale=widths * varies.scale,
        fixed=theta,
        precision=np.where(is_tolerance, varies.precision, varies.precision / _TWO_DRAWS**2),
        lower=lower,
    )
    return about.restrict(kept, np.zeros(varies.size))
