"""Check of lengths: positions in millimetres where metres are expected."""

from pathlib import Path

import numpy as np

from identification.words import InputError, Layout, Real

_MAX_SIZE_M = 100.0  # distance of points on a machine: above it, positions are hardly in metres
_MIN_SIZE_M = 1e-3  # and below it
_MAX_ARM_M = 20.0  # of a sensor from the centre of mass of its body, in the median
_MAX_ARM_TO_SPREAD = 100.0  # such arms over the distance of the bodies' centres


def check_lengths(path: Path, layout: Layout) -> list[str]:
    """Return remarks on a layout whose size is hardly one in metres.

    Args:
        layout: bodies with their centres of mass, and points.

    Raises:
        InputError: sensors and hammer points lie 100 times farther from their bodies' centres of
            mass than these lie from each other, and more than 20 m.
    """
    size = _spread(layout.positions)
    if size == 0:
        return []
    arms = np.linalg.norm(layout.positions - layout.centres[layout.body_of], axis=1)
    arm, spread = float(np.median(arms)), _spread(layout.centres)
    if spread > 0 and arm > max(_MAX_ARM_M, _MAX_ARM_TO_SPREAD * spread):
        raise InputError(
            f"{path}: points lie {arm:.3g} m from the centres of mass of their bodies, which are "
            f"{spread:.3g} m apart, as if positions in mm were read as m: divide the positions of "
            "the sites by 1000"
        )
    if _MIN_SIZE_M <= size <= _MAX_SIZE_M:
        return []
    is_large = size > _MAX_SIZE_M
    advice = "if they were written in mm, divide them by 1000" if is_large else "check their unit"
    return [f"sensors and hammer points lie within {size:.3g} m: positions are in m; {advice}"]


def _spread(positions: Real) -> float:
    """Return the diagonal of the box around positions [m]."""
    return float(np.linalg.norm(np.ptp(positions, axis=0))) if len(positions) else 0.0
