"""Check of each body of a campaign: rigid up to which frequency, and which sensor is faulty.

It compares the readings with the rigid motion that all channels determine (seed, ch. 2.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from identification.solid.body_channels import (
    ChannelTable,
    body_data,
    drop_still_channels,
    join_tests,
    list_dead_channels,
)
from identification.solid.body_search import correct_spectrum, search_body
from identification.solid.confounded_faults import (
    find_confounded,
    find_near_ties,
    find_unidentifiable,
)
from identification.solid.fault_search import FaultSearch, is_within_tolerance
from identification.solid.frequency_limit import ResidualSpectrum, highest_solid_hz
from identification.solid.sensor_faults import FaultHypothesis
from identification.solid.sentences import body_sentence, confounded_phrase, fault_phrase
from identification.solid.swapped_bodies import (
    BodySwap,
    MovedSensor,
    find_body_swap,
    find_moved_sensor,
)
from identification.unknown_gains import leave_out_unknown_gains
from identification.words import Campaign, Dof, Real, Tolerance, frozen_array


@dataclass(frozen=True, eq=False)
class Fault:
    """A fault of one sensor or of two, or a flexible body.

    Args:
        effect: sensor_gain, sensor_polarity, sensor_misalignment, sensor_position, sensor_swap,
            sensor_delay, mount_resonance, dead_channel, sensor_body, sensor_unknown or
            flexible_body.
        location: ``sensor:acc12``, ``sensor:acc1+acc2`` or ``body:ty``.
        dof: directions such as ``tz`` or ``tx+ty``, or None for all.
        probability: posterior probability, given the faults that were named before it.
        parameters: gain; rotation [rad] and offset [m] in world axes; delay [s]; frequency [Hz],
            damping ratio.
        excess_after: residual over noise with this fault corrected; noise alone gives 1.
        of_hits: the fault of the hits at a reference (hammer_gain, hammer_delay) that breaks
            reciprocity in the same way; None where redundant channels prove that of the sensor.
    """

    effect: str
    location: str
    dof: str | None
    probability: float
    parameters: dict[str, float | tuple[float, ...]]
    excess_after: float
    of_hits: Annotated["Fault | None", Field(exclude=True)] = None


@dataclass(frozen=True, eq=False)
class BodyCheck:
    """Result of the check of one body by its redundant channels.

    Args:
        body: name of the body.
        channels: measured channels, except those that read zero, and those that read only noise
            where no motion is expected.
        rank: how many of the six rigid motions they determine.
        redundant: number of channels beyond those.
        freq_hz: frequency lines [Hz]; (n_freq,).
        reconstruction: relative difference of readings and their rigid reconstruction, with the
            nominal sensors; (n_freq,).
        expected: relative difference that noise and tolerances alone would give; (n_freq,).
        deviation: share of the motion that is not rigid beyond noise, with errors of sensors
            fitted; (n_freq,).
        hidden: deviation that the noise would hide; (n_freq,).
        excess: residual over noise, with errors of sensors fitted; (n_freq,).
        solid_to_hz: highest frequency up to which the body moves as a solid within one per cent;
            None if it never does or the channels do not determine it.
        faults: faults in the order in which they were found.
        has_unexplained: whether a significant residual remains beside them.
        confounded: pairs of labels of faults that these channels cannot tell apart.
        unidentifiable: labels of single errors that could be large without a trace in these
            channels.
        sentence: the result in words.
        moved: sensor that moves with another body than drawn, if one of both is this body.
    """

    body: str
    channels: tuple[Dof, ...]
    rank: int
    redundant: int
    freq_hz: Real
    reconstruction: Real
    expected: Real
    deviation: Real
    hidden: Real
    excess: Real
    solid_to_hz: float | None
    faults: tuple[Fault, ...]
    has_unexplained: bool
    confounded: tuple[tuple[str, str], ...]
    unidentifiable: tuple[str, ...]
    sentence: str
    moved: MovedSensor | None = None

    def __post_init__(self) -> None:
        """Copy the curves and make them read-only."""
        curves = ("freq_hz", "reconstruction", "expected", "deviation", "hidden", "excess")
        for name in curves:
            value = frozen_array(getattr(self, name), np.float64, (None,), name)
            object.__setattr__(self, name, value)


def check_bodies(
    campaign: Campaign, bodies: tuple[str, ...] | None = None
) -> tuple[BodyCheck, ...]:
    """Check every body of a campaign that has channels, in the order of the layout.

    Errors of sensors within tolerance are fitted with all motions projected out. What then remains
    beyond noise is a fault of a sensor or a flexible shape. Tests of one reference, level and speed
    are used together, whichever channels each of them has. Sensors of unknown gain are left out.
    Every n-th line of a large test is enough, since each line is an equation of its own.

    Args:
        campaign: measured FRFs on the lines to be used.
        bodies: names of the bodies to be checked; all if None.

    Returns:
        One check a body.
    """
    comparable = leave_out_unknown_gains(campaign, hammers=False)
    if comparable is None:
        return ()
    campaign, tolerance = comparable.thin_lines(), campaign.tolerance
    table = join_tests(campaign)
    searches = _searches(table, campaign, bodies)
    swap = find_body_swap(table, campaign, list(searches.values()))
    if swap is not None:
        searches |= _searches(swap.table, campaign, swap.bodies)
    moved = None if swap is not None else find_moved_sensor(table, campaign, [*searches.values()])
    if moved is not None:
        campaign = moved.campaign
        searches |= _searches(table, campaign, moved.bodies)
    dead = list_dead_channels(campaign)
    return tuple(
        _assemble_check(
            search,
            tolerance,
            (swap, moved),
            [dof for dof in dead if campaign.layout.body_name(dof.point) == body],
        )
        for body, search in searches.items()
    )


def _searches(
    table: ChannelTable, campaign: Campaign, bodies: tuple[str, ...] | None = None
) -> dict[str, FaultSearch]:
    """Search for faults on every body with channels, or on the named bodies only."""
    names = campaign.layout.bodies if bodies is None else bodies
    channels = [body_data(table, campaign, body) for body in names]
    active = [drop_still_channels(data, campaign.layout) for data in channels if data is not None]
    return {data.body: search_body(data, campaign.tolerance) for data in active}


def _assemble_check(
    search: FaultSearch,
    tolerance: Tolerance,
    elsewhere: tuple[BodySwap | None, MovedSensor | None],
    dead: Sequence[Dof],
) -> BodyCheck:
    """Assemble the check of one body from its search, and its channels that read zero."""
    swap, moved = elsewhere
    data = search.data
    if moved is not None and data.body not in moved.bodies:
        moved = None
    last = search.rankings[-1].body_fit if search.rankings else None
    residuals, shapes_matter = correct_spectrum(data, tolerance, search)
    faults = _list_faults(search, residuals, tolerance, shapes_matter=shapes_matter)
    excess = search.excess(0)
    if swap is not None and data.body in swap.bodies:
        swapped = Fault("sensor_swap", swap.location, None, swap.probability, {}, excess)
        faults = (swapped, *faults)
    if moved is not None:
        place = f"sensor:{moved.site}"
        faults = (Fault("sensor_body", place, None, moved.probability, {}, excess), *faults)
    silent = [
        Fault("dead_channel", f"sensor:{dof.point}", dof.direction[1:], 1.0, {}, excess)
        for dof in dead
    ]
    faults = (*silent, *faults)
    return BodyCheck(
        body=data.body,
        channels=data.sensors.channels,
        rank=search.rank,
        redundant=search.redundant,
        freq_hz=data.freq_hz,
        reconstruction=residuals.reconstruction,
        expected=residuals.expected,
        deviation=residuals.deviation,
        hidden=residuals.hidden,
        excess=residuals.excess,
        solid_to_hz=highest_solid_hz(data.freq_hz, residuals.exceeds_bound)
        if search.redundant
        else None,
        faults=faults,
        has_unexplained=search.has_unexplained,
        confounded=find_confounded(search.rankings[0], last, tolerance) if last else (),
        unidentifiable=find_unidentifiable(last, tolerance) if last else (),
        sentence=_check_sentence(search, residuals, faults, tolerance, moved),
        moved=moved,
    )


def _check_sentence(
    search: FaultSearch,
    residuals: ResidualSpectrum,
    faults: tuple[Fault, ...],
    tolerance: Tolerance,
    moved: MovedSensor | None,
) -> str:
    """Return the result of a body in words."""
    phrases = [] if moved is None else [moved.phrase]
    faults = tuple(fault for fault in faults if fault.effect != "sensor_body")
    phrases += [fault_phrase(fault.effect, fault.location, fault.dof) for fault in faults]
    if search.has_unexplained:
        phrases.append("a residual remains beyond these faults" if faults else "a residual remains")
    if any(fault.effect == "flexible_body" for fault in faults) and len(faults) > 1:
        phrases.append("a flexible body can hide a sensor fault, or look like one")
    if not search.rankings and search.redundant > 1 and residuals.exceeds_bound.any():
        phrases.append(
            f"the body is flexible; with {search.redundant} redundant channels single sensors are "
            "not checked"
        )
    if search.rankings and residuals.exceeds_bound.any() and not phrases:
        phrases.append(
            "no single cause explains it: the body is flexible, or several sensors are faulty"
        )
    if faults and search.rankings:
        phrases += [
            confounded_phrase(*pair, search.redundant)
            for pair in find_near_ties(search.rankings[0])[:1]
        ]
    if search.rankings and (hidden := find_unidentifiable(search.rankings[-1].body_fit, tolerance)):
        phrases.append(f"faults that these channels cannot show: {', '.join(hidden)}")
    counts = (len(search.data.sensors.channels), search.rank, search.redundant)
    return body_sentence(search.data.body, counts, search.data.freq_hz, residuals, phrases)


def _list_faults(
    search: FaultSearch, residuals: ResidualSpectrum, tolerance: Tolerance, *, shapes_matter: bool
) -> tuple[Fault, ...]:
    """List each effect and place once.

    What lies within tolerance is no fault: an error of a sensor, or a flexible shape below the
    bound of rigidity.
    """
    freq_hz = search.data.freq_hz
    faults: dict[tuple[str, str, str | None], Fault] = {}
    for number, accepted in enumerate(search.accepted):
        effect, location, dof = accepted.hypothesis.key
        if accepted.hypothesis.frees_shape and not shapes_matter:
            continue
        if effect == "flexible_body" and not residuals.exceeds_bound.any():
            continue
        if not accepted.dead and is_within_tolerance(
            accepted.hypothesis, search.errors, accepted.parameters, freq_hz, tolerance
        ):
            continue
        parameters = _fault_parameters(
            accepted.hypothesis, search.errors[list(accepted.hypothesis.channels)]
        )
        parameters |= dict(zip(("frequency", "damping"), accepted.parameters, strict=False))
        if effect == "sensor_delay":
            parameters = {"delay": accepted.parameters[0]}
        if effect == "flexible_body":
            peak = int(np.argmax(np.where(residuals.exceeds_bound, residuals.deviation, 0.0)))
            parameters = {"frequency": float(freq_hz[peak])}
        if accepted.dead:
            effect, parameters = "dead_channel", {}
        fault = Fault(
            effect, location, dof, accepted.probability, parameters, search.excess(number + 1)
        )
        faults.setdefault((effect, location, dof), fault)
    return tuple(faults.values())


def _fault_parameters(
    hypothesis: FaultHypothesis, errors: Real
) -> dict[str, float | tuple[float, ...]]:
    """Return the released errors under the names that the result uses."""
    if hypothesis.effect == "sensor_gain":
        return {"gain": 1 + float(errors[0])}
    name = {"sensor_misalignment": "rotation", "sensor_position": "offset"}.get(hypothesis.effect)
    return {name: tuple(float(x) for x in errors)} if name else {}
