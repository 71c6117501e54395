"""Poles of several model orders that are one mode."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.modal.lscf_method import Poles
from identification.words import Complex


@dataclass(frozen=True)
class Tolerances:
    """When two poles count as the same mode, and which poles are physical.

    Args:
        frequency: relative difference.
        damping: relative difference.
        participation: least modal assurance criterion of the participation.
        persistence: least share of the orders in which a mode comes back.
        highest_damping: ratio above which a pole is no mode.
        collinearity: least modal phase collinearity (MPC) of a shape.
        phase_deviation: greatest mean phase deviation (MPD) of a shape [rad].
    """

    frequency: float = 0.01
    damping: float = 0.3
    participation: float = 0.8
    persistence: float = 0.3
    highest_damping: float = 0.2
    collinearity: float = 0.0
    phase_deviation: float = np.pi


@dataclass(frozen=True, eq=False)
class Cluster:
    """Poles of several orders that are one mode.

    Args:
        pole: their median [rad/s].
        participation: of the pole nearest to it; (n_in,).
        count: orders in which it comes back.
        freq_sd, damping_sd: standard deviations over the orders [Hz, 1].
    """

    pole: complex
    participation: Complex
    count: int
    freq_sd: float
    damping_sd: float


def cluster_poles(
    orders: Sequence[Poles], band: tuple[float, float], tolerances: Tolerances
) -> tuple[Cluster, ...]:
    """Group the physical poles of the upper half of the orders.

    The pole with neighbours in most other orders makes the first cluster, the next of those left
    the second, until they come back in too few orders.
    """
    upper = orders[len(orders) // 2 :]
    freq = np.concatenate([order.freq_hz for order in upper])
    damping = np.concatenate([order.damping for order in upper])
    poles = np.concatenate([order.poles for order in upper])
    shapes = np.hstack([order.participation for order in upper])
    number = np.repeat(np.arange(len(upper)), [len(order.poles) for order in upper])
    physical = (damping > 0) & (damping < tolerances.highest_damping)
    physical &= (freq >= band[0]) & (freq <= band[1])
    freq, damping, poles = freq[physical], damping[physical], poles[physical]
    shapes, number = shapes[:, physical], number[physical]
    alike = np.abs(freq[:, None] / freq - 1) <= tolerances.frequency
    alike &= np.abs(damping[:, None] - damping) <= tolerances.damping * damping
    alike &= np.abs(shapes.conj().T @ shapes) ** 2 >= tolerances.participation
    left = np.ones(len(freq), bool)
    order_of = (number[:, None] == np.arange(len(upper))).astype(np.float32)
    counts = alike.astype(np.float32) @ order_of
    clusters = []
    while left.any():
        seen = (counts > 0.5).sum(axis=1) * left
        best = int(np.argmax(seen))
        if seen[best] < max(2.0, tolerances.persistence * len(upper)):
            break
        own = np.flatnonzero(alike[best] & left)
        middle = np.median(poles[own].real) + 1j * np.median(poles[own].imag)
        nearest = own[np.argmin(np.abs(poles[own] - middle))]
        clusters.append(
            Cluster(
                complex(middle),
                shapes[:, nearest],
                int(seen[best]),
                float(freq[own].std()),
                float(damping[own].std()),
            )
        )
        left[own] = False
        counts -= alike[:, own].astype(np.float32) @ order_of[own]
    return tuple(sorted(clusters, key=lambda cluster: abs(cluster.pole)))
