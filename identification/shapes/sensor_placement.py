r"""Where to put sensors, and how well a layout tells modes apart.

Antinodes, as the seed document has it: the places where each mode moves most. But places where all
modes move tell none from another. Effective independence (Kammer 1991) takes out, one by one, the
candidate that adds least to det(Phi' Phi), Phi the modes at the candidates: that with the smallest

    E = diag(Phi (Phi' Phi)^-1 Phi'),

so that what is left tells the amplitudes of all modes with the least variance. Two modes with a MAC
near one at the sensors are confused by whatever compares shapes there; with noise of sigma per
channel and shapes of unit size they are d = sqrt(1 - MAC) / sigma deviations apart.
"""

from dataclasses import dataclass

import numpy as np

from identification.modal import auto_mac
from identification.words import Integers, Real, UsageError

_ALIKE = 0.8  # MAC of modes that a layout is said to confuse
_TINY = 1e-9


def antinodes(candidates: Real, each: int = 1, apart: Real | None = None) -> Integers:
    """Places where modes move most: of every mode its greatest, until all have so many.

    Args:
        candidates: modes at the candidates; (n_mode, n_candidate, 3), or (n_mode, n_candidate).
        each: places for every mode.
        apart: distances between candidates divided by the least that two sensors may have;
            (n_candidate, n_candidate). None to let them be neighbours.

    Returns:
        Numbers of candidates, each once, in the order of the modes.
    """
    size = np.abs(candidates) if candidates.ndim == 2 else np.linalg.norm(candidates, axis=2)
    chosen: list[int] = []
    for mode in size:
        taken = 0
        for place in np.argsort(-mode, kind="stable").tolist():
            if taken == each:
                break
            near = apart is not None and any(apart[place, one] < 1 for one in chosen)
            if place not in chosen and not near:
                chosen.append(place)
            taken += 1 if place in chosen else 0
    return np.array(chosen, np.intp)


def effective_independence(candidates: Real, count: int) -> Integers:
    """The channels that tell the amplitudes of all modes best.

    Args:
        candidates: modes at the candidate channels; (n_mode, n_candidate).
        count: channels to be left; at least the number of modes.

    Returns:
        Numbers of candidates, rising; (count,).

    Raises:
        UsageError: fewer channels than modes, or modes that no channels tell apart.
    """
    modes, left = len(candidates), np.arange(candidates.shape[1])
    if modes > len(left):
        raise UsageError(
            f"{len(left)} candidates cannot tell {modes} modes apart. Let places be nearer to each "
            "other, or ask for fewer modes."
        )
    if not modes <= count <= len(left):
        raise UsageError(
            f"{count} channels of {len(left)} candidates cannot tell {modes} modes apart. Ask for "
            f"between {modes} and {len(left)}."
        )
    while len(left) > count:
        basis, sizes, _ = np.linalg.svd(candidates[:, left].T, full_matrices=False)
        if sizes[-1] < _TINY * sizes[0]:
            raise UsageError(
                f"Some of the {modes} modes are the same at all candidates. Leave one of them out, "
                "or give candidates where they differ."
            )
        left = np.delete(left, (basis**2).sum(axis=1).argmin())
    return left


@dataclass(frozen=True, eq=False)
class Telling:
    """How well a layout tells modes apart.

    Args:
        mac: of every pair of modes at the channels; (n_mode, n_mode).
        confused: pairs that are alike, the most alike first.
        deviations: by how many standard deviations each pair differs; (n_mode, n_mode).
        channels: for each confused pair, channels by how much they tell it, the best first.
    """

    mac: Real
    confused: tuple[tuple[int, int], ...]
    deviations: Real
    channels: tuple[tuple[int, ...], ...]


def telling(at: Real, noise: float = 0.1, alike: float = _ALIKE) -> Telling:
    """How well channels tell modes apart.

    Args:
        at: modes at the channels, signed; (n_mode, n_channel).
        noise: standard deviation of a channel, of a shape of unit size.
        alike: MAC above which a pair counts as confused.
    """
    table = auto_mac(at.T.astype(complex))
    pairs = [(i, j) for i in range(len(at)) for j in range(i) if table[i, j] > alike]
    pairs.sort(key=lambda pair: -table[pair])
    best = []
    for i, j in pairs:
        one, other = (at[k] / max(np.linalg.norm(at[k]), 1e-300) for k in (i, j))
        differs = np.abs(one - np.sign(one @ other) * other)
        best.append(tuple(np.argsort(-differs, kind="stable").tolist()))
    return Telling(
        table,
        tuple((j, i) for i, j in pairs),
        np.sqrt(np.maximum(1 - table, 0.0)) / noise,
        tuple(best),
    )
