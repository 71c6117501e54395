"""Faults of sensors that redundant channels or reciprocity prove, without any model.

One exchanged sensor ruins a whole fit. Proven gross faults are therefore taken out before any fit.
Each proven fault becomes a hypothesis. It corrects the channels if the correction is known (sign,
exchange, delay, mounting), or releases tolerances that a fit must find (gain, axes, place).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from diagnosis.corrections import find_correction, mask_channels, match_channels
from diagnosis.data_checks.bending_bodies import (
    GROSS,
    RELEASED,
    find_constant_errors,
    key_of,
    list_probable,
    reduce_to_bending,
)
from diagnosis.effects.flexible_body import build_bending_hypothesis
from diagnosis.hypothesis import Hypothesis, release_tolerance
from diagnosis.inference.evidence import BENDS, Key
from diagnosis.scene_points import list_gains, name_vector
from diagnosis.settings import DiagnosisSettings
from identification import (
    BodyCheck,
    Fault,
    check_bodies,
    check_reciprocity,
    duplicate_channels,
    noise_only_channels,
)
from identification.words import Campaign, Output
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
        campaign: ``alive`` without the channels of gross faults, any of which ruins a fit; what
            reciprocity proves is corrected instead.
        reciprocal: those of the faults that reciprocity proves.
    """

    bodies: tuple[BodyCheck, ...]
    faults: tuple[Fault, ...]
    alive: Campaign
    campaign: Campaign
    reciprocal: tuple[Fault, ...] = ()

    def blame_hits(self, fault: Fault) -> "SensorChecks | None":
        """Return these checks with a fault of the hits in place of that of a channel.

        Args:
            fault: one that reciprocity proves.

        Returns:
            None where the fault is that of the channel alone.
        """
        if fault.of_hits is None:
            return None
        faults, reciprocal = (
            tuple(fault.of_hits if each is fault else each for each in group)
            for group in (self.faults, self.reciprocal)
        )
        campaign = _take_out(self.alive, faults, reciprocal)
        return replace(self, faults=faults, campaign=campaign, reciprocal=reciprocal)

    @property
    def gross(self) -> tuple[Fault, ...]:
        """Exchanged channels, opposite signs and unreciprocal ones, which every set has."""
        return tuple(
            fault for fault in self.faults if fault.effect in GROSS or fault in self.reciprocal
        )

    @property
    def small(self) -> tuple[Fault, ...]:
        """Faults of some size, which compete with all other hypotheses."""
        gross = self.gross
        return tuple(f for f in self.faults if f.effect not in _USELESS and f not in gross)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Places of sensors with an unknown fault."""
        places = (fault.location for fault in self.faults if fault.effect == _UNKNOWN)
        return tuple(dict.fromkeys(places))


def check_sensors(
    campaign: Campaign,
    settings: DiagnosisSettings,
    doubt: str = "",
    before: Campaign | None = None,
) -> SensorChecks:
    """Check every body by its redundant channels, all by reciprocity, and take gross faults out.

    Args:
        campaign: all that was measured.
        settings: probability of a proven fault, number of bodies that bend.
        doubt: why the machine need not be reciprocal; empty if it is.
        before: tests before a change, whose reciprocity is that of these tests without it.
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
    reciprocity = check_reciprocity(campaign, doubt, before)
    unreciprocal = () if reciprocity is None else reciprocity.faults(campaign)
    reciprocal = [fault for fault in unreciprocal if key_of(fault) not in proven]
    proven |= {key_of(fault): fault for fault in reciprocal}
    faults = tuple(fault for fault in proven.values() if _is_credible(fault, campaign, silent))
    useless = [fault for fault in faults if fault.effect in _USELESS]
    audible = mask_channels(campaign, lambda dof: dof.positive in silent) if silent else campaign
    moved = {check.moved.phrase: None for check in bodies if check.moved is not None}
    remarks = (f"{phrase}; its channels were left out of the diagnosis" for phrase in moved)
    audible = replace(audible, remarks=(*audible.remarks, *remarks))
    alive = _remove_channels(audible, useless)
    return SensorChecks(
        bodies, faults, alive, _take_out(alive, faults, reciprocal), tuple(reciprocal)
    )


def _take_out(campaign: Campaign, faults: Sequence[Fault], reciprocal: Sequence[Fault]) -> Campaign:
    """Return the campaign without the channels of gross faults.

    Args:
        campaign: all channels that are of use.
        reciprocal: those of them that reciprocity proves, which are corrected.
    """
    corrections = (find_correction(fault, campaign) for fault in reciprocal)
    right = reduce(lambda c, correct: correct(c), filter(None, corrections), campaign)
    gross = [fault for fault in faults if fault.effect in GROSS and fault not in reciprocal]
    return _remove_channels(right, gross)


def _is_credible(fault: Fault, campaign: Campaign, silent: Collection[Output]) -> bool:
    """Return whether a fault is more than the silence of channels that read noise alone.

    Args:
        fault: proven fault.
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
    *,
    is_certain: bool = False,
) -> Hypothesis | None:
    """Return the hypothesis of a fault; None if it is no effect of the catalogue.

    Args:
        fault: proven or known fault.
        bodies: all bodies that bend, if the fault is the bending of one of them.
        correct_campaign: campaign without wrong channels; the whole campaign if None.
        frequency_ratio: start of the frequency of a mode, relative to its highest peak.
        is_certain: whether the size is that of the fault, and no fit finds it.
    """
    if fault.effect == BENDS:
        campaign = correct_campaign or session.campaign
        return build_bending_hypothesis(fault, bodies, session, campaign, frequency_ratio)
    site = fault.location.partition(":")[2]
    if fault.effect in RELEASED and not is_certain:
        tolerance, stated = RELEASED[fault.effect]
        prefix = f"{site}.{tolerance}_"
        names = name_vector(prefix) if fault.dof is None else (dict(list_gains(site))[fault.dof],)
        hypothesis = release_tolerance(fault.effect, fault.location, fault.dof, names, stated)
        values = np.ravel(fault.parameters[stated]).tolist()
        return replace(hypothesis, begin=dict(zip(names, values, strict=True)))
    correct = find_correction(fault, session.campaign)
    if correct is None:
        return None
    return Hypothesis(
        fault.effect,
        fault.location,
        fault.dof,
        correct=correct,
        state=lambda _: dict(fault.parameters),
    )
