"""Does each stage move as a solid, up to which frequency, and which sensor lies (seed, ch. 2.2)."""

from dataclasses import dataclass, replace

import numpy as np

from identification.solid.body_channels import BodyData, Table, body_data, gather
from identification.solid.confounded_faults import close_pairs, twins, unseen
from identification.solid.fault_search import Search, search
from identification.solid.frequency_limit import Spectrum, solid_to, spectrum
from identification.solid.sensor_faults import Hypothesis, State
from identification.solid.sentences import alike, phrase, verdict
from identification.solid.silent_channels import without_still
from identification.solid.swapped_bodies import Crossed, crossed
from identification.words import Campaign, Dof, Real, Tolerance, frozen


@dataclass(frozen=True, eq=False)
class Fault:
    """What is wrong with one sensor, with two of them, or with the body as a solid.

    Args:
        effect: sensor_gain, sensor_polarity, sensor_misalignment, sensor_position, sensor_swap,
            sensor_delay, mount_resonance, dead_channel, sensor_unknown or flexible_body.
        location: ``sensor:acc12``, ``sensor:acc1+acc2`` or ``body:ty``.
        dof: such as ``tz`` or ``tx+ty``, or None for all.
        probability: that it is present, given what was named before it.
        parameters: gain; rotation [rad] and offset [m] in world axes; delay [s]; frequency [Hz],
            damping.
        excess_after: residual over noise with it, 1 is noise alone.
    """

    effect: str
    location: str
    dof: str | None
    probability: float
    parameters: dict[str, float | tuple[float, ...]]
    excess_after: float


@dataclass(frozen=True, eq=False)
class BodyCheck:
    """What the spare channels of a body say.

    Args:
        body: its name.
        channels: measured on it, but for those that read noise alone where nothing should move.
        rank: of the six motions, how many they determine.
        spare: channels beyond those.
        freq_hz: lines [Hz]; (n_freq,).
        reconstruction: relative difference of readings and their rigid reconstruction, sensors as
            drawn; (n_freq,).
        expected: the same that noise and tolerances alone would give; (n_freq,).
        deviation: share of the motion that is not rigid, errors fitted, beyond noise; (n_freq,).
        hidden: deviation that the noise would hide there; (n_freq,).
        excess: residual over noise, errors fitted; (n_freq,).
        solid_to_hz: highest frequency up to which it moves as a solid within one per cent; None if
            it never does or nothing can be said.
        faults: in the order in which they were found.
        more: whether something significant remains beside them.
        twins: pairs of labels that these channels cannot tell apart.
        unseen: labels of single errors that could be large and leave no mark in these channels.
        words: the verdict in words.
    """

    body: str
    channels: tuple[Dof, ...]
    rank: int
    spare: int
    freq_hz: Real
    reconstruction: Real
    expected: Real
    deviation: Real
    hidden: Real
    excess: Real
    solid_to_hz: float | None
    faults: tuple[Fault, ...]
    more: bool
    twins: tuple[tuple[str, str], ...]
    unseen: tuple[str, ...]
    words: str

    def __post_init__(self) -> None:
        """Freeze."""
        curves = ("freq_hz", "reconstruction", "expected", "deviation", "hidden", "excess")
        for name in curves:
            value = frozen(getattr(self, name), np.float64, (None,), name)
            object.__setattr__(self, name, value)


def check_bodies(campaign: Campaign) -> tuple[BodyCheck, ...]:
    """Check every body of a campaign that has channels, in the layout's order.

    Errors of sensors within tolerance are fitted with all motions projected out; what then remains
    beyond noise is a fault of a sensor or a shape that is not rigid. Tests of one reference, level
    and speed are used together, whichever channels each of them has.

    Args:
        campaign: on the lines to be used.

    Returns:
        One check a body.
    """
    tolerance = campaign.tolerance
    table = gather(campaign)
    searches = _searches(table, campaign)
    swap = crossed(table, campaign, list(searches.values()))
    if swap is not None:
        searches |= _searches(swap.table, campaign, swap.bodies)
    return tuple(_check(one, tolerance, swap) for one in searches.values())


def _searches(
    table: Table, campaign: Campaign, bodies: tuple[str, ...] | None = None
) -> dict[str, Search]:
    wanted = campaign.layout.bodies if bodies is None else bodies
    found = [body_data(table, campaign, body) for body in wanted]
    moving = [without_still(data, campaign.layout) for data in found if data is not None]
    return {data.body: search(data, campaign.tolerance) for data in moving}


def _check(found: Search, tolerance: Tolerance, swap: Crossed | None) -> BodyCheck:
    data = found.data
    last = found.rankings[-1].look if found.rankings else None
    seen, shapes_matter = _spectrum(data, tolerance, found)
    faults = _faults(found, seen, data.freq_hz, shapes_matter=shapes_matter)
    if swap is not None and data.body in swap.bodies:
        after = found.excess(0)
        faults = (
            Fault("sensor_swap", swap.location, None, swap.probability, {}, after),
            *faults,
        )
    return BodyCheck(
        body=data.body,
        channels=data.sensors.channels,
        rank=found.rank,
        spare=found.spare,
        freq_hz=data.freq_hz,
        reconstruction=seen.reconstruction,
        expected=seen.expected,
        deviation=seen.deviation,
        hidden=seen.hidden,
        excess=seen.excess,
        solid_to_hz=solid_to(data.freq_hz, seen.beyond) if found.spare else None,
        faults=faults,
        more=found.more,
        twins=twins(found.rankings[0], last, tolerance) if last else (),
        unseen=unseen(last, tolerance) if last else (),
        words=_words(found, seen, faults, tolerance),
    )


def _words(found: Search, seen: Spectrum, faults: tuple[Fault, ...], tolerance: Tolerance) -> str:
    phrases = [phrase(one.effect, one.location, one.dof) for one in faults]
    if found.more:
        phrases.append("more remains than that explains" if faults else "something remains")
    if any(one.effect == "flexible_body" for one in faults) and len(faults) > 1:
        phrases.append("beside a flexible body a sensor's fault is hardly told from its shape")
    if not found.rankings and found.spare > 1 and seen.beyond.any():
        phrases.append(f"of {found.spare} spare channels no single one is asked: it is flexible")
    if found.rankings and seen.beyond.any() and not phrases:
        phrases.append("no single cause explains that: it is flexible, or many sensors are wrong")
    if faults and found.rankings:
        phrases += [alike(*pair, found.spare) for pair in close_pairs(found.rankings[0])[:1]]
    if found.rankings and (hidden := unseen(found.rankings[-1].look, tolerance)):
        phrases.append(f"unseen by these channels: {', '.join(hidden)}")
    counts = (len(found.data.sensors.channels), found.rank, found.spare)
    return verdict(found.data.body, counts, found.data.freq_hz, seen, phrases)


def _spectrum(data: BodyData, tolerance: Tolerance, found: Search) -> tuple[Spectrum, bool]:
    """What remains with the sensors' faults taken out, but not what is flexible.

    Returns:
        The spectrum, and whether free shapes matter: not if the body is solid with all of them
        left in, but for dead channels.
    """
    drawn, state = State.healthy(data, tolerance), found.state
    shaped = [one for one in found.taken if one.shaped]

    def seen_without(left_out: list[bool]) -> Spectrum:
        model = replace(state.model, extra=state.extra[:, left_out])
        return spectrum(state, drawn, model, found.errors, found.noise_scale)

    seen = seen_without([one.dead for one in shaped])
    if not seen.beyond.any():
        return seen, False
    return seen_without([one.hypothesis.effect != "flexible_body" for one in shaped]), True


def _faults(
    found: Search, seen: Spectrum, freq_hz: Real, *, shapes_matter: bool
) -> tuple[Fault, ...]:
    """Each effect and place once; a shape below the bound of solidity is no fault."""
    faults: dict[tuple[str, str, str | None], Fault] = {}
    for number, one in enumerate(found.taken):
        effect, location, dof = one.hypothesis.key
        if one.hypothesis.shaped and not shapes_matter:
            continue
        if effect == "flexible_body" and not seen.beyond.any():
            continue
        parameters = _parameters(one.hypothesis, found.errors[list(one.hypothesis.channels)])
        parameters |= dict(zip(("frequency", "damping"), one.parameters, strict=False))
        if effect == "sensor_delay":
            parameters = {"delay": one.parameters[0]}
        if effect == "flexible_body":
            peak = int(np.argmax(np.where(seen.beyond, seen.deviation, 0.0)))
            parameters = {"frequency": float(freq_hz[peak])}
        if one.dead:
            effect, parameters = "dead_channel", {}
        fault = Fault(effect, location, dof, one.probability, parameters, found.excess(number + 1))
        faults.setdefault((effect, location, dof), fault)
    return tuple(faults.values())


def _parameters(one: Hypothesis, errors: Real) -> dict[str, float | tuple[float, ...]]:
    """What was released, as the verdict calls it."""
    if one.effect == "sensor_gain":
        return {"gain": 1 + float(errors[0])}
    name = {"sensor_misalignment": "rotation", "sensor_position": "offset"}.get(one.effect)
    return {name: tuple(float(x) for x in errors)} if name else {}
