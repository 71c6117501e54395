"""The sensor gate: faults that the spare channels of a body prove, without any model.

One exchanged sensor ruins a whole fit. So what is proven is taken out before anything is tuned,
and becomes a hypothesis: channels corrected where the correction is known (sign, exchange, delay,
mount), tolerances released where the fit has to find it (gain, axes, place).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np

from diagnosis.corrections import (
    Reading,
    divide_channels,
    exchange_channels,
    mask_channels,
    match_channels,
)
from diagnosis.effects.flexible_body import build_bending_hypothesis
from diagnosis.effects.points import list_gains, name_vector
from diagnosis.effects.sensor_polarity import read_inverted
from diagnosis.hypothesis import Hypothesis, Value, release_tolerance
from diagnosis.inference.evidence import BENDS, Key
from identification import (
    BodyCheck,
    Fault,
    check_bodies,
    delay_response,
    duplicate_channels,
    mount_response,
    noise_only_channels,
)
from identification.words import Campaign, Dof
from tuning import Session

_GROSS = ("dead_channel", "sensor_polarity", "sensor_swap")
_UNKNOWN = "sensor_unknown"
_TELLS_NOTHING = ("dead_channel", _UNKNOWN)
_TOO_MANY = 2  # sensors of one body that are wrong by some amount each, bodies that bend
PROVEN = 0.9  # probability above which a fault is taken out
# Tolerance that is released, and what the verdict calls its value.
RELEASED = {
    "sensor_gain": ("gain", "gain"),
    "sensor_misalignment": ("rotation", "rotation"),
    "sensor_position": ("position", "offset"),
}


@dataclass(frozen=True, eq=False)
class Gate:
    """Faults that redundant channels prove.

    Args:
        checks: of every body.
        faults: those that are proven.
        alive: all that was measured but for channels that are dead, read noise alone, or wrong by
            no known fault: nothing can be said of what they should have read.
        campaign: ``alive`` without the channels of gross faults, any of which ruins a fit.
    """

    checks: tuple[BodyCheck, ...]
    faults: tuple[Fault, ...]
    alive: Campaign
    campaign: Campaign

    @property
    def gross(self) -> tuple[Fault, ...]:
        """Exchanged channels and opposite signs, which every set of causes has."""
        return tuple(fault for fault in self.faults if fault.effect in _GROSS)

    @property
    def small(self) -> tuple[Fault, ...]:
        """Faults by some amount: candidates among all others."""
        taken_out = (*_GROSS, _UNKNOWN)
        return tuple(fault for fault in self.faults if fault.effect not in taken_out)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Places of sensors that are wrong by no known fault."""
        places = (fault.location for fault in self.faults if fault.effect == _UNKNOWN)
        return tuple(dict.fromkeys(places))


def check_sensors(campaign: Campaign) -> Gate:
    """Check every body by its redundant channels, and take gross faults out.

    Args:
        campaign: all that was measured.
    """
    checks, same = check_bodies(campaign), duplicate_channels(campaign)
    # What reads noise alone is dead, or still: either way it tells nothing, of a fault neither.
    none = noise_only_channels(campaign)
    proven: dict[Key, Fault] = {}
    flexible = 0
    for check in checks:
        sure = [fault for fault in check.faults if fault.probability >= PROVEN]
        kept = [wrong for fault in sure for wrong in _exported_twice(fault, same)]
        kept += _one_cause(check, [fault for fault in sure if not _exported_twice(fault, same)])
        flexible += any(fault.effect == BENDS for fault in kept)
        proven |= {(fault.effect, fault.location, fault.dof): fault for fault in kept}
    if flexible > _TOO_MANY:  # several bodies bend a little, the noise is not what is stated, or
        # set-ups met different machines: small faults of sensors then explain a part of that
        proven = {key: fault for key, fault in proven.items() if key[0] in (BENDS, *_GROSS)}
    faults = tuple(fault for fault in proven.values() if _is_heard(fault, campaign, none))
    dead = [fault for fault in faults if fault.effect in _TELLS_NOTHING]
    heard = mask_channels(campaign, lambda dof: dof.positive in none) if none else campaign
    alive = _without(heard, dead)
    gross = [fault for fault in faults if fault.effect in (*_GROSS, *_TELLS_NOTHING)]
    return Gate(checks, faults, alive, _without(heard, gross))


def _is_heard(fault: Fault, campaign: Campaign, none: Collection[Dof]) -> bool:
    """Whether a fault may be believed: of channels that read noise alone, no more than that.

    Args:
        fault: proven, as it seems.
        campaign: all that was measured.
        none: channels that read noise alone.
    """
    if fault.effect in _TELLS_NOTHING or not fault.location.startswith("sensor:"):
        return True
    concerns = match_channels(fault.location, fault.dof)
    return any(concerns(dof) and dof.positive not in none for dof in campaign.outputs)


def _exported_twice(fault: Fault, same: frozenset[Dof]) -> list[Fault]:
    """Return the unknown faults of channels that hold the numbers of other channels.

    Args:
        fault: fault of a sensor, or of a body.
        same: channels that hold the numbers of others.
    """
    if not fault.location.startswith("sensor:"):
        return []
    concerns = match_channels(fault.location, fault.dof)
    return [
        replace(fault, effect=_UNKNOWN, location=f"sensor:{dof.point}", dof=dof.direction[1:])
        for dof in sorted(same, key=str)
        if concerns(dof)
    ]


def _one_cause(check: BodyCheck, sure: list[Fault]) -> list[Fault]:
    """Small faults of several sensors of one body at once are one bending of it.

    Below its resonance a mode's shape follows the acceleration: what each sensor reads too much is
    then a gain, or a place, of its own, and a few of them explain a shape to the noise. But faults
    are rare and do not come in pairs. Gross ones stand out beside a shape too.
    """
    small = [fault for fault in sure if fault.effect not in (BENDS, *_GROSS)]
    remaining = [fault for fault in sure if fault not in small]
    if not any(fault.effect == BENDS for fault in sure):
        if len({fault.location for fault in small}) < _TOO_MANY:
            return sure
        after = min(fault.excess_after for fault in small)
        return [Fault(BENDS, f"body:{check.body}", None, PROVEN, {}, after), *remaining]
    if check.deviation[-1] > 0.5 * check.deviation.max():  # no peak of a mode lies in the band
        remaining = [
            replace(fault, parameters={}) if fault.effect == BENDS else fault for fault in remaining
        ]
    return remaining


def _without(campaign: Campaign, faults: Sequence[Fault]) -> Campaign:
    """All channels but those that faults of sensors concern."""
    sensors = [fault for fault in faults if fault.location.startswith("sensor:")]
    return reduce(
        mask_channels, (match_channels(fault.location, fault.dof) for fault in sensors), campaign
    )


def build_fault_hypothesis(
    fault: Fault,
    session: Session,
    bodies: Sequence[str] = (),
    good: Campaign | None = None,
    times: float = 1.0,
) -> Hypothesis | None:
    """The hypothesis of a fault; None of one that is no effect of the catalogue.

    Args:
        fault: proven by the gate, or told.
        session: campaign and model.
        bodies: all that bend, for one of them.
        good: the campaign without wrong channels; all of it if None.
        times: where a mode's frequency begins, over that of its highest peak.
    """
    if fault.effect == BENDS:
        return build_bending_hypothesis(fault, bodies, session, good or session.campaign, times)
    base = Hypothesis(fault.effect, fault.location, fault.dof)
    site = fault.location.partition(":")[2]
    concerns = match_channels(fault.location, fault.dof)
    if fault.effect in RELEASED:
        tolerance, stated = RELEASED[fault.effect]
        prefix = f"{site}.{tolerance}_"
        names = name_vector(prefix) if fault.dof is None else (dict(list_gains(site))[fault.dof],)
        hypothesis = release_tolerance(fault.effect, fault.location, fault.dof, names, stated)
        values = np.ravel(fault.parameters[stated]).tolist()
        return replace(hypothesis, begin=dict(zip(names, values, strict=True)))
    if fault.effect == "sensor_polarity":
        return replace(base, correct=lambda c: divide_channels(c, concerns, read_inverted))
    if fault.effect == "sensor_swap":
        pairs = _pairs(fault, session.campaign)
        return replace(base, correct=lambda c: exchange_channels(c, pairs))
    reading = _reading(fault)
    if reading is None:
        return None
    return replace(
        base,
        correct=lambda c: divide_channels(c, concerns, reading),
        state=lambda _: dict(fault.parameters),
    )


def _reading(fault: Fault) -> Reading | None:
    """Return the reading of a faulty channel per motion; None for another kind of fault."""
    if fault.effect == "sensor_delay":
        return partial(delay_response, delay=_number(fault.parameters["delay"]))
    if fault.effect == "mount_resonance":
        frequency, damping = (_number(fault.parameters[k]) for k in ("frequency", "damping"))
        return lambda freq_hz: mount_response(freq_hz, frequency, damping)
    return None


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
