"""Faults of single sensors and the bending of their body, which imitate each other."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.inference.evidence import BENDS, Key
from diagnosis.settings import DiagnosisSettings
from identification import BodyCheck, Fault, check_bodies
from identification.words import Campaign, Real
from tuning.assessment.held_out import MIN_BLOCK_LINES

GROSS = ("dead_channel", "sensor_polarity", "sensor_swap")
# Tolerance that an effect releases, and the name of its value in the verdict.
RELEASED = {
    "sensor_gain": ("gain", "gain"),
    "sensor_misalignment": ("rotation", "rotation"),
    "sensor_position": ("position", "offset"),
}


def list_probable(check: BodyCheck, settings: DiagnosisSettings) -> list[Fault]:
    """Return the faults of a body that count as proven."""
    least = settings.min_proven_probability
    return [fault for fault in check.faults if fault.probability >= least]


def reduce_to_bending(check: BodyCheck, probable: list[Fault], probability: float) -> list[Fault]:
    """Replace small faults of several sensors of one body by one bending of the body.

    Below the resonance the shape of a mode follows the acceleration. The deviation of each sensor
    is then equal to that of a gain or a place, and a few such faults explain a shape to within the
    noise. But faults are rare and do not come in pairs. Gross faults stand out beside a shape too.

    Args:
        probable: faults of its sensors, or its bending.
        probability: probability of the bending that replaces them.
    """
    small = [fault for fault in probable if fault.effect not in (BENDS, *GROSS)]
    remaining = [fault for fault in probable if fault not in small]
    if not any(fault.effect == BENDS for fault in probable):
        if len({fault.location for fault in small}) <= 1:
            return probable
        after = min(fault.excess_after for fault in small)
        return [Fault(BENDS, f"body:{check.body}", None, probability, {}, after), *remaining]
    if check.deviation[-1] > 0.5 * check.deviation.max():  # no peak of a mode lies in the band
        remaining = [
            replace(fault, parameters={}) if fault.effect == BENDS else fault for fault in remaining
        ]
    return remaining


def find_constant_errors(
    campaign: Campaign, check: BodyCheck, faults: Sequence[Fault], settings: DiagnosisSettings
) -> list[Fault]:
    """Return the faults that low lines show in at least half the size: no bending does that.

    A body deforms as (f / f0)^2 relative to its motion. On lines up to half the frequency to which
    it is solid, a fault that only imitates its shape is smaller by four or more. A wrong gain,
    axis or place is the same on all lines.

    Args:
        campaign: all that was measured.
        faults: small faults of its sensors that its bending replaces.
        settings: probability of a proven fault.
    """
    low = campaign.freq_hz <= 0.5 * (check.solid_to_hz or 0.0)
    released = [fault for fault in faults if fault.effect in RELEASED]
    if not released or low.sum() < MIN_BLOCK_LINES:
        return []
    (below,) = check_bodies(campaign.select_lines(low), (check.body,))
    seen = [fault for fault in list_probable(below, settings) if fault.effect in RELEASED]
    sizes = {key_of(fault): _error_of(fault) for fault in seen}
    return [
        fault
        for fault in released
        if key_of(fault) in sizes
        and sizes[key_of(fault)] @ _error_of(fault) >= 0.5 * _error_of(fault) @ _error_of(fault)
    ]


def _error_of(fault: Fault) -> Real:
    """Return the error of a sensor that a fault states: gain less one, rotation or offset."""
    ((name, value),) = fault.parameters.items()
    return np.atleast_1d(np.asarray(value, float) - (name == "gain"))


def key_of(fault: Fault) -> Key:
    """Return effect, place and directions of a fault."""
    return fault.effect, fault.location, fault.dof
