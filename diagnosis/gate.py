"""The sensor gate: faults that the spare channels of a body prove, without any model.

One exchanged sensor ruins a whole fit. So what is proven is taken out before anything is tuned,
and becomes a hypothesis: channels corrected where the correction is known (sign, exchange, delay,
mount), tolerances released where the fit has to find it (gain, axes, place).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from diagnosis.corrections import Reading, channels_of, divided, exchanged, masked
from diagnosis.effects.points import three
from diagnosis.effects.sensor_polarity import turned
from diagnosis.hypothesis import Hypothesis, Value, released
from identification import BodyCheck, Fault, check_bodies, delayed, mount
from identification.words import Campaign, Dof

PROVEN = 0.9  # probability above which a fault is taken out
# Tolerance that is released, and what the verdict calls its value.
_RELEASED = {
    "sensor_gain": ("gain", "gain"),
    "sensor_misalignment": ("rotation", "rotation"),
    "sensor_position": ("position", "offset"),
}


@dataclass(frozen=True, eq=False)
class Gate:
    """What the gate found.

    Args:
        checks: of every body.
        faults: those that are proven.
        alive: all that was measured but for dead channels.
        campaign: without the channels that any proven fault concerns.
        flexible: bodies that are not solid in part of the band.
    """

    checks: tuple[BodyCheck, ...]
    faults: tuple[Fault, ...]
    alive: Campaign
    campaign: Campaign
    flexible: tuple[BodyCheck, ...]


def sensor_gate(campaign: Campaign) -> Gate:
    """Check every body, take out what is proven."""
    checks = check_bodies(campaign)
    found = [fault for check in checks for fault in check.faults]
    proven = {
        (fault.effect, fault.location, fault.dof): fault
        for fault in found
        if fault.probability >= PROVEN and fault.location.startswith("sensor:")
    }
    flexible = tuple(
        check
        for check in checks
        if any(one.effect == "flexible_body" and one.probability >= PROVEN for one in check.faults)
    )
    faults = tuple(proven.values())
    dead = [one for one in faults if one.effect == "dead_channel"]
    alive, clean = _without(campaign, dead), _without(campaign, faults)
    return Gate(checks, faults, alive, clean, flexible)


def _without(campaign: Campaign, faults: Sequence[Fault]) -> Campaign:
    """All channels but those that faults concern."""
    return reduce(masked, (channels_of(one.location, one.dof) for one in faults), campaign)


def hypothesis_of(fault: Fault, campaign: Campaign) -> Hypothesis | None:
    """The hypothesis of a fault; None of one that is no effect of the catalogue."""
    base = Hypothesis(fault.effect, fault.location, fault.dof)
    site = fault.location.partition(":")[2]
    concerned = channels_of(fault.location, fault.dof)
    if fault.effect in _RELEASED:
        tolerance, stated = _RELEASED[fault.effect]
        prefix = f"{site}.{tolerance}_"
        names = three(prefix) if fault.dof is None else (f"{prefix}{fault.dof[1:]}",)
        one = released(fault.effect, fault.location, fault.dof, names, stated)
        values = np.ravel(fault.parameters[stated]).tolist()
        return replace(one, begin=dict(zip(names, values, strict=True)))
    if fault.effect == "sensor_polarity":
        return replace(base, correct=lambda c: divided(c, concerned, turned))
    if fault.effect == "sensor_swap":
        pairs = _pairs(fault, campaign)
        return replace(base, correct=lambda c: exchanged(c, pairs))
    readings: dict[str, Reading] = {}
    if fault.effect == "sensor_delay":
        readings["sensor_delay"] = lambda f: delayed(f, _number(fault.parameters["delay"]))
    if fault.effect == "mount_resonance":
        at = _number(fault.parameters["frequency"]), _number(fault.parameters["damping"])
        readings["mount_resonance"] = lambda f: mount(f, *at)
    if fault.effect not in readings:
        return None
    reading = readings[fault.effect]
    return replace(
        base,
        correct=lambda c: divided(c, concerned, reading),
        state=lambda _: dict(fault.parameters),
    )


def _number(value: Value) -> float:
    return value if isinstance(value, float) else value[0]


def _pairs(fault: Fault, campaign: Campaign) -> tuple[tuple[Dof, Dof], ...]:
    """Channels that are exchanged: two of one sensor, or all of two sensors."""
    sites = fault.location.partition(":")[2].split("+")
    if len(sites) == 1:
        first, second = str(fault.dof).split("+")
        return ((Dof.parse(f"{sites[0]}:+{first}"), Dof.parse(f"{sites[0]}:+{second}")),)
    axes = [dof.direction[1:] for dof in campaign.outputs if dof.point == sites[0]]
    return tuple(
        (Dof.parse(f"{sites[0]}:+{axis}"), Dof.parse(f"{sites[1]}:+{axis}")) for axis in axes
    )
