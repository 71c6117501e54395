"""Clusters of poles of several model orders that describe one mode."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.modal.lscf_method import Poles
from identification.words import Complex

# A growing mode: share of the orders in which it recurs, at least, and standard deviation of its
# frequency over its half-power half-width, at most. Poles that fit noise grow too, but they move
# with the order: over 30 to 55 orders of ten machines their share was at most 0.84 and their
# scatter at least 0.1; those of growing modes had 1.0 and at most 0.06 with 5 % noise.
_MIN_GROWING_SHARE, _MAX_GROWING_SCATTER = 0.9, 0.1


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


def find_growing_modes(
    orders: Sequence[Poles],
    band: tuple[float, float],
    criteria: ModeCriteria,
    decaying: Sequence[PoleCluster],
) -> tuple[PoleCluster, ...]:
    """Find modes with negative damping: growing poles that stay at one place in almost all orders.

    A plant that was measured in its loop may have such a mode. Where a decaying mode has its
    frequency, the growing pole is the mirror image that two-sided responses have, and no mode.

    Args:
        orders, band [Hz]: as for ``cluster_poles``.
        decaying: clusters of decaying poles.

    Returns:
        Clusters by rising frequency.
    """
    upper_orders = orders[len(orders) // 2 :]
    last = upper_orders[-1]
    is_growing = (last.damping < 0) & (last.damping > -criteria.highest_damping)
    is_growing &= (last.freq_hz >= band[0]) & (last.freq_hz <= band[1])
    clusters = []
    for number in np.flatnonzero(is_growing):
        pole, row = last.poles[number], last.participation[:, number]
        if any(abs(mode.pole + pole.conjugate()) < abs(pole.real) for mode in decaying):
            continue
        members = [near for order in upper_orders if (near := _nearest(order, pole, row, criteria))]
        freq = np.array([abs(member) for member in members]) / (2 * np.pi)
        damping = np.array([-member.real / abs(member) for member in members])
        scatter = float(freq.std()) / (abs(float(np.median(damping))) * float(np.median(freq)))
        if len(members) < _MIN_GROWING_SHARE * len(upper_orders) or scatter > _MAX_GROWING_SCATTER:
            continue
        median = complex(np.median(np.real(members)), np.median(np.imag(members)))
        clusters.append(
            PoleCluster(median, row, len(members), float(freq.std()), float(damping.std()))
        )
    return tuple(sorted(clusters, key=lambda cluster: abs(cluster.pole)))


def _nearest(order: Poles, pole: complex, row: Complex, criteria: ModeCriteria) -> complex | None:
    """Return the pole of an order that agrees with a pole and its participation; None for none."""
    damping = -pole.real / abs(pole)
    agrees = np.abs(np.abs(order.poles) / abs(pole) - 1) <= criteria.frequency
    agrees &= np.abs(order.damping - damping) <= criteria.damping * abs(damping)
    agrees &= np.abs(row.conj() @ order.participation) ** 2 >= criteria.participation
    if not agrees.any():
        return None
    distance = np.where(agrees, np.abs(order.poles - pole), np.inf)
    return complex(order.poles[int(distance.argmin())])
