"""Clusters of poles of several model orders that describe one mode."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.modal.lscf_method import Poles
from identification.words import Complex


@dataclass(frozen=True)
class ModeCriteria:
    """Criteria by which two poles count as one mode, and by which a mode is accepted.

    Args:
        frequency: largest relative difference of frequency in a cluster.
        damping: largest relative difference of damping in a cluster.
        participation: smallest MAC of the participation in a cluster.
        persistence: smallest share of the orders in which a mode recurs.
        highest_damping: damping ratio above which a pole is not physical.
        collinearity: smallest modal phase collinearity (MPC) of a shape.
        phase_deviation: largest mean phase deviation (MPD) of a shape [rad].
    """

    frequency: float = 0.01
    damping: float = 0.3
    participation: float = 0.8
    persistence: float = 0.3
    highest_damping: float = 0.2
    collinearity: float = 0.0
    phase_deviation: float = np.pi


@dataclass(frozen=True, eq=False)
class PoleCluster:
    """Poles of several model orders that describe one mode.

    Args:
        pole: median of the poles [rad/s].
        participation: participation of the pole nearest to the median; (n_in,).
        count: number of orders in which the pole recurs.
        freq_sd, damping_sd: standard deviations over the orders [Hz, 1].
    """

    pole: complex
    participation: Complex
    count: int
    freq_sd: float
    damping_sd: float


def cluster_poles(
    orders: Sequence[Poles], band: tuple[float, float], criteria: ModeCriteria
) -> tuple[PoleCluster, ...]:
    """Group the physical poles of the upper half of the model orders.

    The pole with neighbours in most other orders forms the first cluster. The next of the remaining
    poles forms the second, until a pole recurs in too few orders.

    Args:
        orders: poles of every order, rising.
        band: lowest and highest frequency [Hz].
        criteria: when poles count as one mode.

    Returns:
        Clusters by rising frequency.
    """
    upper_orders = orders[len(orders) // 2 :]
    freq = np.concatenate([order.freq_hz for order in upper_orders])
    damping = np.concatenate([order.damping for order in upper_orders])
    poles = np.concatenate([order.poles for order in upper_orders])
    shapes = np.hstack([order.participation for order in upper_orders])
    order_index = np.repeat(
        np.arange(len(upper_orders)), [len(order.poles) for order in upper_orders]
    )
    physical = (damping > 0) & (damping < criteria.highest_damping)
    physical &= (freq >= band[0]) & (freq <= band[1])
    freq, damping, poles = freq[physical], damping[physical], poles[physical]
    shapes, order_index = shapes[:, physical], order_index[physical]
    agrees = np.abs(freq[:, None] / freq - 1) <= criteria.frequency
    agrees &= np.abs(damping[:, None] - damping) <= criteria.damping * damping
    agrees &= np.abs(shapes.conj().T @ shapes) ** 2 >= criteria.participation
    is_free = np.ones(len(freq), bool)
    order_indicator = (order_index[:, None] == np.arange(len(upper_orders))).astype(np.float32)
    counts = agrees.astype(np.float32) @ order_indicator
    clusters = []
    while is_free.any():
        n_orders = (counts > 0.5).sum(axis=1) * is_free
        best = int(np.argmax(n_orders))
        if n_orders[best] < max(2.0, criteria.persistence * len(upper_orders)):
            break
        members = np.flatnonzero(agrees[best] & is_free)
        median = np.median(poles[members].real) + 1j * np.median(poles[members].imag)
        nearest = members[np.argmin(np.abs(poles[members] - median))]
        clusters.append(
            PoleCluster(
                complex(median),
                shapes[:, nearest],
                int(n_orders[best]),
                float(freq[members].std()),
                float(damping[members].std()),
            )
        )
        is_free[members] = False
        counts -= agrees[:, members].astype(np.float32) @ order_indicator[members]
    return tuple(sorted(clusters, key=lambda cluster: abs(cluster.pole)))
