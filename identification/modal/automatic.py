"""From FRFs to modes without a click: clusters of stable poles, refined, completed, pruned.

Poles of the upper half of the model orders that agree in frequency, damping and participation make
a cluster; those that keep coming back start the refinement (``fit``). What the fit leaves is then
searched for modes that the polynomials missed, inside the band and beside it, and a mode that
explains no more than noise would is dropped.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.modal.fit import Data, ModalFit, cost_without, refine
from identification.modal.lscf import Poles, lscf
from identification.words import Complex, Mask, Real

_ROOTS = 120  # of the highest order, over all inputs
_ADDED = 12  # modes searched in what is left, at most
_ROUGH = 0.05  # of that drop, at which a search on the way has settled
_NOISE = 3.0  # times the number of its parameters that a mode must lower the cost


@dataclass(frozen=True)
class Tolerances:
    """When two poles count as the same mode, and which poles are physical.

    Args:
        frequency: relative difference.
        damping: relative difference.
        participation: least modal assurance criterion of the participation.
        persistence: least share of the orders in which a mode comes back.
        highest_damping: ratio above which a pole is no mode.
    """

    frequency: float = 0.01
    damping: float = 0.3
    participation: float = 0.8
    persistence: float = 0.3
    highest_damping: float = 0.2


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


@dataclass(frozen=True, eq=False)
class Identified:
    """Modes of measured FRFs.

    Args:
        fit: all poles that were fitted, by rising frequency.
        inside: which lie in the band: the others stand for what lies beside it.
        freq_sd: standard deviations of the natural frequencies [Hz]; (n_mode,).
        damping_sd: of the damping ratios; (n_mode,).
        orders: poles of every order, for a stabilisation diagram.
        clusters: where the refinement started.
        misfit: sum of |error|^2 over variance, per value that the fit left free: 1 is the noise.
    """

    fit: ModalFit
    inside: Mask
    freq_sd: Real
    damping_sd: Real
    orders: tuple[Poles, ...]
    clusters: tuple[Cluster, ...]
    misfit: float


def identify_modes(
    data: Data, freq_hz: Real, tolerances: Tolerances | None = None, *, roots: int = _ROOTS
) -> Identified:
    """Find the modes of a set of FRFs.

    Where there are more inputs than outputs, as of a roving hammer, both are exchanged on the way.

    Args:
        data: FRFs and weights of one over the variance.
        freq_hz: evenly spaced lines [Hz]; (n_freq,).
        tolerances: when poles count as one mode.
        roots: of the highest order.

    Returns:
        Modes with their standard deviations.
    """
    tolerances = tolerances or Tolerances()
    values = data.values
    if values.shape[2] > values.shape[1]:
        turned = identify_modes(_exchanged(data), freq_hz, tolerances, roots=roots)
        return replace(turned, fit=_exchanged_fit(turned.fit))
    n_in = values.shape[2]
    size = np.sqrt((np.abs(values) ** 2).mean(axis=(0, 2)))
    rows = values[:, size > 0] / size[size > 0, None]
    highest = min(-(-roots // n_in), len(freq_hz) // 2 - 1)
    orders = lscf(freq_hz, rows, highest)
    clusters = cluster_poles(orders, (freq_hz[0], freq_hz[-1]), tolerances)
    # An exponential window moves the poles that the polynomials see by its own decay.
    poles = np.array([cluster.pole for cluster in clusters]) + data.laplace[0].real
    participation = np.array([cluster.participation for cluster in clusters]).T.reshape(n_in, -1)
    found, matrix = _completed(data, freq_hz, poles, participation, tolerances)
    order = np.argsort(np.abs(found.poles))
    misfit = _misfit(data, found, len(matrix))
    freq_sd, damping_sd = (max(1.0, misfit) ** 0.5 * sd for sd in _deviations(found, matrix))
    found = replace(
        found,
        poles=found.poles[order],
        participation=found.participation[:, order],
        shapes=found.shapes[:, order],
    )
    inside = (found.freq_hz >= freq_hz[0]) & (found.freq_hz <= freq_hz[-1])
    return Identified(found, inside, freq_sd[order], damping_sd[order], orders, clusters, misfit)


def _exchanged(data: Data) -> Data:
    """Outputs for inputs: of a roving hammer the few fixed sensors are the references."""
    return replace(
        data,
        values=data.values.transpose(0, 2, 1),
        weights=data.weights.transpose(0, 2, 1),
        cells=data.cells.T,
    )


def _exchanged_fit(fit: ModalFit) -> ModalFit:
    return replace(
        fit,
        participation=fit.shapes,
        shapes=fit.participation,
        lower=fit.lower.T,
        upper=fit.upper.T,
    )


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
    clusters = []
    while left.any():
        members = alike & left
        seen = np.array([len(set(number[row])) for row in members]) * left
        best = int(np.argmax(seen))
        if seen[best] < max(2.0, tolerances.persistence * len(upper)):
            break
        own = np.flatnonzero(members[best])
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
    return tuple(sorted(clusters, key=lambda cluster: abs(cluster.pole)))


def _completed(
    data: Data,
    freq_hz: Real,
    poles: Complex,
    participation: Complex,
    tolerances: Tolerances,
) -> tuple[ModalFit, Real]:
    """Refine, add what the remainder shows, drop what noise could explain."""
    rough = _ROUGH * _threshold(data)
    found, _ = refine(data, poles, participation, settled=rough)
    for _ in range(_ADDED):
        more = [
            refine(
                data,
                np.append(found.poles, pole),
                np.column_stack([found.participation, row]),
                settled=rough,
            )[0]
            for pole, row in _candidates(data, freq_hz, found)
        ]
        better = min(more, key=lambda fit: fit.cost)
        if found.cost - better.cost < _threshold(data):
            break
        found = better
    found, matrix = refine(data, found.poles, found.participation)
    keep = (cost_without(data, found) > _threshold(data)) & _physical(found, tolerances)
    if not keep.all():
        found, matrix = refine(data, found.poles[keep], found.participation[:, keep])
    return found, matrix


def _threshold(data: Data) -> float:
    n_out, n_in = data.cells.shape
    return float(_NOISE * (2 + 2 * (n_in - 1) + 2 * n_out))


def _candidates(data: Data, freq_hz: Real, found: ModalFit) -> list[tuple[complex, Complex]]:
    """Poles with participation where the weighted remainder is largest, and just above the band."""
    error = data.values - found.values(data.laplace, data.order)
    error = error * np.sqrt(data.weights * data.cells)
    size = np.linalg.norm(error, ord=2, axis=(1, 2)) ** 2
    smooth = np.convolve(size, np.ones(5) / 5, mode="same")
    peak = int(np.argmax(smooth))
    places = [freq_hz[peak]]
    if peak > 0.9 * len(freq_hz):
        places.append(1.08 * freq_hz[-1])
    rows = np.linalg.svd(error[max(0, peak - 2) : peak + 3].reshape(-1, error.shape[2]))[2]
    damping = float(np.median(found.damping)) if len(found.poles) else 0.01
    return [
        (complex(2 * np.pi * place * (-damping + 1j * np.sqrt(1 - damping**2))), rows[0])
        for place in places
    ]


def _physical(found: ModalFit, tolerances: Tolerances) -> Mask:
    physical: Mask = (found.damping > 0) & (found.damping < 2 * tolerances.highest_damping)
    return physical


def _misfit(data: Data, found: ModalFit, curved: int) -> float:
    """Cost per free value: a complex value has two numbers, a parameter takes one of them."""
    cells = int((data.cells > 0).sum())
    n_out, n_in = data.cells.shape
    taken = curved + n_out * (2 * len(found.poles) + 2 * n_in)
    return float(found.cost / max(cells * len(data.laplace) - taken / 2, 1.0))


def _deviations(found: ModalFit, matrix: Real) -> tuple[Real, Real]:
    """Standard deviations of frequency [Hz] and damping ratio; (n_mode,) each.

    cov(Re s, Im s) is half the inverse of the normal matrix; |s| and -Re s / |s| follow to first
    order. What the model does not hold, as modes far beside the band, is not in them.
    """
    m = len(found.poles)
    covariance = np.linalg.inv(matrix) / 2
    own = np.arange(m)
    real, imag = found.poles.real, found.poles.imag
    size = np.abs(found.poles)
    var_r, var_i = covariance[own, own], covariance[m + own, m + own]
    both = covariance[own, m + own]
    frequency = (real**2 * var_r + imag**2 * var_i + 2 * real * imag * both) / size**2
    slope_r, slope_i = -(imag**2) / size**3, real * imag / size**3
    damping = slope_r**2 * var_r + slope_i**2 * var_i + 2 * slope_r * slope_i * both
    return np.sqrt(frequency) / (2 * np.pi), np.sqrt(damping)
