"""Sensor placement, and how well a layout of sensors distinguishes modes.

The antinodes of the seed document are the places where each mode moves most. But places where all
modes move do not distinguish them. Effective independence (Kammer 1991) removes, one by one, the
candidate that adds least to det(Phi' Phi), Phi the modes at the candidates: the one with the
smallest

    E = diag(Phi (Phi' Phi)^-1 Phi'),

so that the remaining candidates determine the amplitudes of all modes with the least variance. Two
modes with a MAC near one at the sensors cannot be distinguished by their shapes there. With noise
of sigma per channel and shapes of unit size they are d = sqrt(1 - MAC) / sigma standard deviations
apart.
"""

from dataclasses import dataclass

import numpy as np

from identification.modal import auto_mac
from identification.words import Integers, Real, UsageError

_CONFUSED_MAC = 0.8  # MAC above which a layout confuses two modes
_MIN_INDEPENDENCE = 1e-9  # singular value over the largest below which modes are dependent


def antinodes(candidates: Real, n_each: int = 1, distances: Real | None = None) -> Integers:
    """Return the places where modes move most: the largest of each mode, until all have ``n_each``.

    Args:
        candidates: modes at the candidates; (n_mode, n_candidate, 3), or (n_mode, n_candidate).
        n_each: number of places for every mode.
        distances: distances between candidates over the smallest distance between two sensors;
            (n_candidate, n_candidate). None to allow neighbours.

    Returns:
        Numbers of candidates, each once, in the order of the modes.
    """
    size = np.abs(candidates) if candidates.ndim == 2 else np.linalg.norm(candidates, axis=2)
    chosen: list[int] = []
    for mode in size:
        n_taken = 0
        for place in np.argsort(-mode, kind="stable").tolist():
            if n_taken == n_each:
                break
            is_close = distances is not None and any(
                distances[place, previous] < 1 for previous in chosen
            )
            if place not in chosen and not is_close:
                chosen.append(place)
            n_taken += 1 if place in chosen else 0
    return np.array(chosen, np.intp)


def effective_independence(candidates: Real, count: int) -> Integers:
    """Select the channels that determine the amplitudes of all modes best (Kammer 1991).

    Args:
        candidates: modes at the candidate channels; (n_mode, n_candidate).
        count: number of channels to select; at least the number of modes.

    Returns:
        Numbers of candidates, rising; (count,).

    Raises:
        UsageError: fewer channels than modes, or modes that no channels distinguish.
    """
    modes, remaining = len(candidates), np.arange(candidates.shape[1])
    if modes > len(remaining):
        raise UsageError(
            f"{len(remaining)} candidates cannot tell {modes} modes apart. Allow places nearer to "
            "each other, or select fewer modes."
        )
    if not modes <= count <= len(remaining):
        raise UsageError(
            f"{count} channels of {len(remaining)} candidates cannot tell {modes} modes apart. "
            f"Select between {modes} and {len(remaining)}."
        )
    while len(remaining) > count:
        basis, sizes, _ = np.linalg.svd(candidates[:, remaining].T, full_matrices=False)
        if sizes[-1] < _MIN_INDEPENDENCE * sizes[0]:
            raise UsageError(
                f"Some of the {modes} modes are equal at all candidates. Leave one of them out, "
                "or give candidates where they differ."
            )
        remaining = np.delete(remaining, (basis**2).sum(axis=1).argmin())
    return remaining


@dataclass(frozen=True, eq=False)
class ModeDistinction:
    """How well a layout distinguishes modes.

    Args:
        mac: MAC of every pair of modes at the channels; (n_mode, n_mode).
        confused: pairs of modes that the layout confuses, largest MAC first.
        deviations: number of standard deviations by which each pair differs; (n_mode, n_mode).
        channels: for each confused pair, channels by how much they distinguish it, the best first.
    """

    mac: Real
    confused: tuple[tuple[int, int], ...]
    deviations: Real
    channels: tuple[tuple[int, ...], ...]


def distinguish_modes(
    shapes: Real, noise: float = 0.1, max_mac: float = _CONFUSED_MAC
) -> ModeDistinction:
    """Compute how well channels distinguish modes.

    Args:
        shapes: modes at the channels, signed; (n_mode, n_channel).
        noise: standard deviation of a channel, for a shape of unit size.
        max_mac: MAC above which a pair counts as confused.
    """
    criterion = auto_mac(shapes.T.astype(complex))
    pairs = [(i, j) for i in range(len(shapes)) for j in range(i) if criterion[i, j] > max_mac]
    pairs.sort(key=lambda pair: -criterion[pair])
    ranked = []
    for i, j in pairs:
        first, second = (shapes[k] / max(np.linalg.norm(shapes[k]), 1e-300) for k in (i, j))
        difference = np.abs(first - np.sign(first @ second) * second)
        ranked.append(tuple(np.argsort(-difference, kind="stable").tolist()))
    return ModeDistinction(
        criterion,
        tuple((j, i) for i, j in pairs),
        np.sqrt(np.maximum(1 - criterion, 0.0)) / noise,
        tuple(ranked),
    )
