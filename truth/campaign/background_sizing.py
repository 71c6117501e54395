"""Scale a background so that it leaves a given part of the motion of a re-tuned machine."""

from dataclasses import replace

import numpy as np

from truth.background.draw import Background
from truth.campaign.survival import SurvivalRefit
from truth.errors import TruthError
from truth.machine.station import Real

_MOTION_TOLERANCE = 0.05  # relative difference from the wanted part at which the search ends
_MIN_RELATIVE_MOTION = 1e-9  # relative motion below which there is rounding alone
_MAX_REFITS = 8  # refits at most
_LARGEST_STEP = 4.0  # factor on the scale in one turn
_MAX_NOISE = 0.3  # relative noise from which a channel does not count, as in a verdict's error


def size_background(background: Background, refit: SurvivalRefit, wanted: float) -> Background:
    """Return the background at the scale at which a refit leaves the wanted part of the motion.

    What is left is ``sqrt(mean e_c^2)`` over the channels whose noise is at most 0.3 of their
    motion, with e_c the norm of the residual over that of the FRF. It grows nearly in proportion to
    the scale, so that a few steps of proportion find it.

    Args:
        background: items at any scale.
        refit: linearised refit of the machine without effects.
        wanted: relative motion, such as 0.15.

    Raises:
        TruthError: the machine has nothing that the background could change.
    """
    best, best_off = background, np.inf
    for _ in range(_MAX_REFITS):
        left = refit.motion_left(replace(refit.machine, effects=background.effects), wanted)
        error = mean_error(left, refit)
        if error < _MIN_RELATIVE_MOTION:
            raise TruthError(f"{refit.machine.station.name}: its background changes no channel")
        off = abs(float(np.log(error / wanted)))
        if off < best_off:
            best, best_off = replace(background, left=left), off
        if off <= _MOTION_TOLERANCE:
            break
        factor = float(np.clip(wanted / error, 1 / _LARGEST_STEP, _LARGEST_STEP))
        background = background.rescale(factor)
    return best


def mean_error(left: Real, refit: SurvivalRefit) -> float:
    """Return the root mean square of the relative errors of the channels that count.

    Args:
        left: relative error of each channel; (n_out, n_in).
        refit: refit of the machine, which knows the noise of each channel.

    Raises:
        TruthError: no channel counts.
    """
    counted = (refit.noise_share <= _MAX_NOISE) & refit.used[:, None]
    if not counted.any():
        raise TruthError(
            f"{refit.machine.station.name}: no channel that is alive has noise of at most "
            f"{_MAX_NOISE:.0%} of its motion, so that small imperfections cannot be sized: add "
            "sensors, or leave the dirt out"
        )
    return float(np.sqrt(np.mean(left[counted] ** 2)))
