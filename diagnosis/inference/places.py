"""Places of a gap: those of its causes, and where an unknown force may act."""

from collections.abc import Sequence

import numpy as np
from scipy.special import softmax

from diagnosis.inference.calibration import Calibration, load_calibration
from diagnosis.inference.evidence import Evidence, ForceGain, Key
from diagnosis.rounding import NEGLIGIBLE_SHARE


def weigh_places(
    evidence: Evidence,
    causes: Sequence[tuple[Key, float]],
    unexplained: float,
    constants: Calibration,
) -> tuple[tuple[str, float], ...]:
    """Return places with their shares, which sum to one.

    Args:
        evidence: fits as plain numbers, and free forces.
        causes: causes with their probabilities.
        unexplained: probability of the empty set with a rest.
        constants: calibrated constants.
    """
    shares: dict[str, float] = {}
    for (_, place, _), probability in causes:
        shares[place] = shares.get(place, 0.0) + probability
    for place in evidence.unknown:
        shares[place] = shares.get(place, 0.0) + unexplained / len(evidence.unknown)
    if not evidence.unknown:
        forces = compute_force_shares(evidence.pushed, constants)
        for place, share in forces.items():
            shares[place] = shares.get(place, 0.0) + max(unexplained, NEGLIGIBLE_SHARE) * share
    total = sum(shares.values())
    order = sorted(shares.items(), key=lambda row: -row[1])
    return tuple((place, share / total) for place, share in order)


def compute_force_shares(
    forces: Sequence[ForceGain], constants: Calibration | None = None
) -> dict[str, float]:
    """Return the share of each place at which an unknown force may act."""
    if not forces:
        return {}
    gains = np.array([max(force.gain, 0.0) for force in forces])
    scale = (constants or load_calibration()).force_scale
    shares = softmax(gains / (scale * max(float(gains.max()), 1.0))).tolist()
    return {force.location: share for force, share in zip(forces, shares, strict=True)}
