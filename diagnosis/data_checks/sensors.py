"""Faults of sensors that redundant channels or reciprocity prove, without any model.

One exchanged sensor ruins a whole fit. Proven gross faults are therefore taken out before any fit.
Each proven fault becomes a hypothesis. It corrects the channels if the correction is known (sign,
exchange, delay, mounting), or releases tolerances that a fit must find (gain, axes, place).
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
from diagnosis.data_checks.bending_bodies import (
    GROSS,
    RELEASED,
    find_constant_errors,
    key_of,
    list_probable,
    reduce_to_bending,
)
from diagnosis.effects.flexible_body import build_bending_hypothesis
from diagnosis.effects.points import list_gains, name_vector
from diagnosis.effects.sensor_polarity import read_inverted
from diagnosis.hypothesis import Hypothesis, Value, release_tolerance
from diagnosis.inference.evidence import BENDS, Key
from diagnosis.settings import DiagnosisSettings
from identification import (
    BodyCheck,
    Fault,
    check_bodies,
    check_reciprocity,
    delay_response,
    duplicate_channels,
    mount_response,
    noise_only_channels,
)
from identification.words import Campaign, Dof, Output
from tuning import Session

_UNKNOWN = "sensor_unknown"
_USELESS = ("dead_channel", "sensor_body", _UNKNOWN)


@dataclass(frozen=True, eq=False)
class SensorChecks:
    """Faults that redundant channels prove.

    Args:
        bodies: check of each body.
        faults: proven faults.
        alive: campaign without useless channels: dead ones, those that read noise alone, and those
            with an unknown fault or on another body than drawn.
        campaign: ``alive`` without the channels of gross faults, any of which ruins a fit.
    """

    bodies: tuple[BodyCheck, ...]
    faults: tuple[Fault, ...]
    alive: Campaign
    campaign: Campaign

    @property
    def gross(self) -> tuple[Fault, ...]:
        """Exchanged channels and opposite signs, which every set of causes has."""
        return tuple(fault for fault in self.faults if fault.effect in GROSS)

    @property
    def small(self) -> tuple[Fault, ...]:
        """Faults of some size, which compete with all other hypotheses."""
        taken_out = (*GROSS, *_USELESS)
        return tuple(fault for fault in self.faults if fault.effect not in taken_out)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Places of sensors with an unknown fault."""
        places = (fault.location for fault in self.faults if fault.effect == _UNKNOWN)
        return tuple(dict.fromkeys(places))


def check_sensors(campaign: Campaign, settings: DiagnosisSettings, doubt: str = "") -> SensorChecks:
    """Check every body by its redundant channels, all by reciprocity, and take gross faults out.

    Args:
        campaign: all that was measured.
        settings: probability of a proven fault, number of bodies that bend.
        doubt: why the machine need not be reciprocal; empty if it is.
    """
    bodies, duplicates = check_bodies(campaign), duplicate_channels(campaign)
    silent = noise_only_channels(campaign)  # dead, or without motion: they show no other fault
    proven: dict[Key, Fault] = {}
    constant: set[Key] = set()
    flexible = 0
    for check in bodies:
        probable = list_probable(check, settings)
        kept = [copy for fault in probable for copy in _replace_duplicates(fault, duplicates)]
        single = [fault for fault in probable if not _replace_duplicates(fault, duplicates)]
        reduced = reduce_to_bending(check, single, settings.min_proven_probability)
        replaced = [fault for fault in single if fault not in reduced and fault.effect != BENDS]
        still = find_constant_errors(campaign, check, replaced, settings)
        kept += reduced + still
        flexible += any(fault.effect == BENDS for fault in kept)
        proven |= {key_of(fault): fault for fault in kept}
        constant |= {key_of(fault) for fault in still}
    if flexible > settings.max_bending_bodies:
        # Many bodies bend a little, the stated noise is wrong, or set-ups met different machines:
        # small faults of sensors explain a part of that.
        proven = {
            key: fault
            for key, fault in proven.items()
            if key[0] in (BENDS, *GROSS) or key in constant
        }
    if reciprocity := check_reciprocity(campaign, doubt):
        proven = {key_of(fault): fault for fault in reciprocity.faults(campaign)} | proven
    faults = tuple(fault for fault in proven.values() if _is_credible(fault, campaign, silent))
    useless = [fault for fault in faults if fault.effect in _USELESS]
    audible = mask_channels(campaign, lambda dof: dof.positive in silent) if silent else campaign
    gross = [fault for fault in faults if fault.effect in (*GROSS, *_USELESS)]
    moved = {check.moved.phrase: None for check in bodies if check.moved is not None}
    remarks = (f"{phrase}; its channels were left out of the diagnosis" for phrase in moved)
    audible = replace(audible, remarks=(*audible.remarks, *remarks))
    return SensorChecks(
        bodies, faults, _remove_channels(audible, useless), _remove_channels(audible, gross)
    )


def _is_credible(fault: Fault, campaign: Campaign, silent: Collection[Output]) -> bool:
    """Return whether a fault is more than the silence of channels that read noise alone.

    Args:
        fault: proven fault.
        campaign: all that was measured.
        silent: channels that read noise alone.
    """
    if fault.effect in _USELESS or not fault.location.startswith("sensor:"):
        return True
    concerns = match_channels(fault.location, fault.dof)
    return any(concerns(dof) and dof.positive not in silent for dof in campaign.outputs)


def _replace_duplicates(fault: Fault, duplicates: frozenset[Output]) -> list[Fault]:
    """Return the unknown faults of channels that hold the numbers of other channels.

    Args:
        fault: fault of a sensor, or of a body.
        duplicates: channels that hold the numbers of others.
    """
    if not fault.location.startswith("sensor:"):
        return []
    concerns = match_channels(fault.location, fault.dof)
    return [
        replace(fault, effect=_UNKNOWN, location=f"sensor:{dof.point}", dof=dof.direction[1:])
        for dof in sorted(duplicates, key=str)
        if concerns(dof)
    ]


def _remove_channels(campaign: Campaign, faults: Sequence[Fault]) -> Campaign:
    """Return the campaign without the channels that faults of sensors concern."""
    sensors = [fault for fault in faults if fault.location.startswith("sensor:")]
    return reduce(
        mask_channels, (match_channels(fault.location, fault.dof) for fault in sensors), campaign
    )


def build_fault_hypothesis(
    fault: Fault,
    session: Session,
    bodies: Sequence[str] = (),
    correct_campaign: Campaign | None = None,
    frequency_ratio: float = 1.0,
) -> Hypothesis | None:
    """Return the hypothesis of a fault; None if it is no effect of the catalogue.

    Args:
        fault: proven or known fault.
        session: campaign and model.
        bodies: all bodies that bend, if the fault is the bending of one of them.
        correct_campaign: campaign without wrong channels; the whole campaign if None.
        frequency_ratio: start of the frequency of a mode, relative to its highest peak.
    """
    if fault.effect == BENDS:
        campaign = correct_campaign or session.campaign
        return build_bending_hypothesis(fault, bodies, session, campaign, frequency_ratio)
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
        pairs = _list_pairs(fault, session.campaign)
        return replace(base, correct=lambda c: exchange_channels(c, pairs))
    reading = _find_reading(fault)
    if reading is None:
        return None
    return replace(
        base,
        correct=lambda c: divide_channels(c, concerns, reading),
        state=lambda _: dict(fault.parameters),
    )


def _find_reading(fault: Fault) -> Reading | None:
    """Return the reading of a faulty channel per motion; None for another kind of fault."""
    if fault.effect == "sensor_delay":
        return partial(delay_response, delay=_read_number(fault.parameters["delay"]))
    if fault.effect == "mount_resonance":
        frequency, damping = (_read_number(fault.parameters[k]) for k in ("frequency", "damping"))
        return lambda freq_hz: mount_response(freq_hz, frequency, damping)
    return None


def _read_number(value: Value) -> float:
    number = value[0] if isinstance(value, tuple) else value
    if number is None:
        raise ValueError("a fault without its number")
    return number


def _list_pairs(fault: Fault, campaign: Campaign) -> tuple[tuple[Dof, Dof], ...]:
    """Return the pairs of exchanged channels: two of one sensor, or all of two sensors."""
    sites = fault.location.partition(":")[2].split("+")
    if len(sites) == 1:
        first, second = str(fault.dof).split("+")
        return ((Dof.parse(f"{sites[0]}:+{first}"), Dof.parse(f"{sites[0]}:+{second}")),)
    axes = [dof.direction[1:] for dof in campaign.outputs if dof.point == sites[0]]
    return tuple(
        (Dof.parse(f"{sites[0]}:+{axis}"), Dof.parse(f"{sites[1]}:+{axis}")) for axis in axes
    )
