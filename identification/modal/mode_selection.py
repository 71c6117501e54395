"""From FRFs to modes without a click: clusters of stable poles, refined, completed, pruned.

Poles of the upper half of the model orders that agree in frequency, damping and participation make
a cluster; those that keep coming back start the refinement (``fit``). What the fit leaves is then
searched for modes that the polynomials missed (``complete``); last come the user's own
(``wishes``).
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.modal.indicators import mpc, mpd
from identification.modal.lscf_method import Poles, lscf
from identification.modal.missing_modes import completed, inside_band
from identification.modal.pole_clusters import Cluster, Tolerances, cluster_poles
from identification.modal.refinement import Data, ModalFit
from identification.modal.user_choices import Wishes, edited
from identification.words import Mask, Real

_ROOTS = 120  # of the highest order, over all inputs
_ROUND = 1e-13  # of the largest eigenvalue of a normal matrix, below which only rounding is left


@dataclass(frozen=True, eq=False)
class Identified:
    """Modes of measured FRFs.

    Args:
        fit: all poles that were fitted, by rising frequency.
        inside: which are modes of the band: the others stand for what lies beside it, or are less
            real than was asked.
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
    data: Data,
    freq_hz: Real,
    tolerances: Tolerances | None = None,
    wishes: Wishes | None = None,
    *,
    roots: int = _ROOTS,
) -> Identified:
    """Find the modes of a set of FRFs.

    Where there are more inputs than outputs, as of a roving hammer, both are exchanged on the way.

    Args:
        data: FRFs and weights of one over the variance.
        freq_hz: evenly spaced lines [Hz]; (n_freq,).
        tolerances: when poles count as one mode.
        wishes: modes to add, drop or force.
        roots: of the highest order.

    Returns:
        Modes with their standard deviations; those of forced poles are 0.

    Raises:
        UsageError: a wish that the data cannot grant.
    """
    tolerances = tolerances or Tolerances()
    values = data.values
    if values.shape[2] > values.shape[1]:
        turned = identify_modes(_exchanged(data), freq_hz, tolerances, wishes, roots=roots)
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
    found, matrix = completed(data, freq_hz, poles, participation, tolerances)
    held = np.zeros(len(found.poles), bool)
    if wishes:
        found, matrix, held = edited(data, freq_hz, found, wishes)
    order = np.argsort(np.abs(found.poles))
    misfit = _misfit(data, found, len(matrix))
    freq_sd, damping_sd = (max(1.0, misfit) ** 0.5 * sd for sd in _deviations(found, matrix, held))
    found = replace(
        found,
        poles=found.poles[order],
        participation=found.participation[:, order],
        shapes=found.shapes[:, order],
    )
    return Identified(
        found,
        inside_band(found, freq_hz) & _real_enough(found, tolerances),
        freq_sd[order],
        damping_sd[order],
        orders,
        clusters,
        misfit,
    )


def _real_enough(found: ModalFit, tolerances: Tolerances) -> Mask:
    """Modes whose phases stray no more than was asked.

    The others stay in the fit, like poles beside the band: without them their neighbours would
    have to stand for them, and stray in their turn.
    """
    kept: Mask = mpc(found.shapes) >= tolerances.collinearity
    kept &= mpd(found.shapes) <= tolerances.phase_deviation
    return kept


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


def _misfit(data: Data, found: ModalFit, curved: int) -> float:
    """Cost per free value: a complex value has two numbers, a parameter takes one of them."""
    cells = int((data.cells > 0).sum())
    n_out, n_in = data.cells.shape
    taken = curved + n_out * (2 * len(found.poles) + 2 * n_in)
    return float(found.cost * data.alike / max(cells * len(data.laplace) - taken / 2, 1.0))


def _deviations(found: ModalFit, matrix: Real, held: Mask) -> tuple[Real, Real]:
    """Standard deviations of frequency [Hz] and damping ratio; (n_mode,) each.

    cov(Re s, Im s) is half the inverse of the normal matrix; |s| and -Re s / |s| follow to first
    order. What the model does not hold is not in them.
    """
    sds = np.zeros((2, len(held)))
    m = int((~held).sum())
    if not m:
        return sds[0], sds[1]
    size = np.sqrt(np.maximum(np.diag(matrix), _ROUND * np.diag(matrix).max()))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    # Poles far beside the band are hardly told apart: rounding must not make that negative.
    scaled = vectors / size[:, None]
    covariance = scaled / np.maximum(values, _ROUND * values[-1]) @ scaled.T / 2
    own = np.arange(m)
    poles = found.poles[~held]
    real, imag, size = poles.real, poles.imag, np.abs(poles)
    var_r, var_i = covariance[own, own], covariance[m + own, m + own]
    both = covariance[own, m + own]
    frequency = (real**2 * var_r + imag**2 * var_i + 2 * real * imag * both) / size**2
    slope_r, slope_i = -(imag**2) / size**3, real * imag / size**3
    damping = slope_r**2 * var_r + slope_i**2 * var_i + 2 * slope_r * slope_i * both
    sds[:, ~held] = np.sqrt(frequency) / (2 * np.pi), np.sqrt(damping)
    return sds[0], sds[1]
