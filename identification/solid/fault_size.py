"""Size of a fault against the tolerance of its sensor: within it nothing is wrong."""

import numpy as np

from identification.solid.sensor_faults import FaultHypothesis, mount_response
from identification.words import TOLERANCE_BOUND_SIGMA, Real, Tolerance


def is_within_tolerance(
    hypothesis: FaultHypothesis,
    errors: Real,
    parameters: tuple[float, ...],
    freq_hz: Real,
    tolerance: Tolerance,
) -> bool:
    """Return whether a fault is at most 2.5 standard deviations of its tolerance large.

    A mount counts by what it changes in the band, |h - 1|, which the gain's tolerance covers: far
    below its frequency f0 it is a gain of 1 / (1 - (f / f0)^2).

    Args:
        errors: errors of all sensors of the body, as fitted with the fault; (n_error,).
        parameters: parameters of its reading, if it has one.
        freq_hz: lines [Hz]; (n_freq,).
    """
    if hypothesis.effect == "sensor_delay":
        size, deviation = abs(parameters[0]), tolerance.sensor_delay
    elif hypothesis.effect == "mount_resonance":
        reading = mount_response(freq_hz, parameters[0], parameters[1])
        size, deviation = float(np.abs(reading - 1).max()), tolerance.sensor_gain
    else:
        released = {
            "sensor_gain": tolerance.sensor_gain,
            "sensor_misalignment": tolerance.sensor_angle,
            "sensor_position": tolerance.sensor_position,
        }
        if hypothesis.effect not in released:
            return False
        size = float(np.abs(errors[list(hypothesis.channels)]).max())
        deviation = released[hypothesis.effect]
    return size <= TOLERANCE_BOUND_SIGMA * deviation
