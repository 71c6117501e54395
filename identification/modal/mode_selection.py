"""Automatic modal identification: clusters of stable poles, refined, completed and pruned.

Poles of the upper half of the model orders that agree in frequency, damping and participation form
a cluster. Clusters that recur in enough orders start the refinement (``refinement``). Then the
residual of the fit is searched for modes that the polynomials missed (``missing_modes``). At last
the choices of the user are applied (``user_choices``). Many channels are compressed before
(``channel_compression``), and shapes are fitted to all of them afterwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.modal.channel_compression import compress_channels
from identification.modal.indicators import mpc, mpd
from identification.modal.lscf_method import Poles, lscf
from identification.modal.missing_modes import add_missing_modes, is_inside_band
from identification.modal.pole_clusters import (
    ModeCriteria,
    PoleCluster,
    cluster_poles,
    find_growing_modes,
)
from identification.modal.refinement import refine
from identification.modal.shape_fit import (
    ModalFit,
    WeightedFrfs,
    fit_shapes,
    shape_deviations,
)
from identification.modal.user_choices import ModeChoices, apply_choices
from identification.words import Complex, Mask, Real

# Roots of the highest model order, over all inputs; some ten times the modes of a usual band.
_N_ROOTS = 120
_QUICK_STEPS = 10  # steps of a refinement without a search for missed modes
# Eigenvalue of a normal matrix over its largest below which only rounding is left.
_EIGENVALUE_FLOOR = 1e-13
_MIN_COMPONENT = 0.1  # of the unit vector of such an eigenvalue: less is rounding as well


@dataclass(frozen=True, eq=False)
class IdentifiedModes:
    """Modes of measured FRFs.

    Args:
        fit: all poles that were fitted, by rising frequency.
        inside: which poles are modes of the band. The others stand for modes outside it, or their
            shapes are less real than was required.
        freq_sd: standard deviations of the natural frequencies [Hz]; (n_mode,).
        damping_sd: standard deviations of the damping ratios; (n_mode,).
        orders: poles of every order, for a stabilisation diagram.
        clusters: where the refinement started.
        misfit: reduced chi-square: sum of |error|^2 over variance per degree of freedom; noise
            gives 1.
        residue_sd: standard deviations of the residues phi_o l_i at given poles;
            (n_out, n_in, n_mode).
    """

    fit: ModalFit
    inside: Mask
    freq_sd: Real
    damping_sd: Real
    orders: tuple[Poles, ...]
    clusters: tuple[PoleCluster, ...]
    misfit: float
    residue_sd: Real


def identify_modes(
    data: WeightedFrfs,
    freq_hz: Real,
    criteria: ModeCriteria | None = None,
    choices: ModeChoices | None = None,
    *,
    roots: int = _N_ROOTS,
    is_quick: bool = False,
) -> IdentifiedModes:
    """Identify the modes of a set of FRFs.

    If there are more inputs than outputs, as in a roving-hammer test, both are exchanged
    internally.

    Args:
        data: FRFs, and weights of one over their variance.
        freq_hz: evenly spaced lines [Hz]; (n_freq,).
        choices: modes to add, drop or force.
        roots: number of roots of the highest order.
        is_quick: whether the stable poles are only refined, without a search for missed modes.

    Returns:
        Modes with their standard deviations; those of forced poles are 0.

    Raises:
        UsageError: a choice that the data do not allow.
    """
    criteria = criteria or ModeCriteria()
    if data.values.shape[2] > data.values.shape[1]:
        transposed = identify_modes(
            _transpose_data(data), freq_hz, criteria, choices, roots=roots, is_quick=is_quick
        )
        return replace(
            transposed,
            fit=_transpose_fit(transposed.fit),
            residue_sd=transposed.residue_sd.transpose(1, 0, 2),
        )
    whole, data = data, compress_channels(data)
    rows, n_in = _rows_for_poles(data), data.values.shape[2]
    highest = min(-(-roots // rows.shape[2]), len(freq_hz) // 2 - 1)
    orders = lscf(freq_hz, rows, highest)
    band = (float(freq_hz[0]), float(freq_hz[-1]))
    clusters = cluster_poles(orders, band, criteria)
    growing = find_growing_modes(orders, band, criteria, clusters)
    clusters = (*clusters, *growing)
    # An exponential window moves the poles that the polynomials see by its own decay.
    poles = np.array([cluster.pole for cluster in clusters]) + data.laplace[0].real
    participation = np.array([cluster.participation for cluster in clusters]).T
    participation = np.broadcast_to(participation.reshape(rows.shape[2], -1), (n_in, len(poles)))
    if is_quick:
        fitted, matrix = refine(data, poles, participation, max_steps=_QUICK_STEPS)
    else:
        fitted, matrix = add_missing_modes(
            data, freq_hz, poles, participation, criteria, n_growing=len(growing)
        )
    fixed = np.zeros(len(fitted.poles), bool)
    if choices:
        fitted, matrix, fixed = apply_choices(data, freq_hz, fitted, choices)
    if data is not whole:
        fitted = fit_shapes(whole, fitted.poles, fitted.participation)
    order = np.argsort(np.abs(fitted.poles))
    reduced_cost = _reduced_cost(whole, fitted, len(matrix))
    freq_sd, damping_sd = (
        max(1.0, reduced_cost) ** 0.5 * sd for sd in _standard_deviations(fitted, matrix, fixed)
    )
    fitted = replace(
        fitted,
        poles=fitted.poles[order],
        participation=fitted.participation[:, order],
        shapes=fitted.shapes[:, order],
    )
    residue_sd = shape_deviations(whole, fitted)[:, None, :] * np.abs(fitted.participation)
    return IdentifiedModes(
        fitted,
        is_inside_band(fitted, freq_hz) & _meets_phase_criteria(fitted, criteria),
        freq_sd[order],
        damping_sd[order],
        orders,
        clusters,
        reduced_cost,
        max(1.0, reduced_cost) ** 0.5 * residue_sd,
    )


def _rows_for_poles(data: WeightedFrfs) -> Complex:
    """Return the scaled FRFs that start the search for poles: outputs measured from every input.

    The zero of a cell that was not measured would be a second shape at each pole, and so a second
    mode. Where fewer outputs than inputs are complete, each measured cell is an output of one.

    Returns:
        (n_freq, n_row, n_in), or (n_freq, n_cell, 1).
    """
    values, is_measured = data.values, data.cells > 0
    complete = is_measured.all(axis=1)
    if complete.sum() < is_measured.shape[1]:
        values, complete = values[:, is_measured][:, :, None], np.ones(is_measured.sum(), bool)
    size = np.sqrt((np.abs(values) ** 2).mean(axis=(0, 2)))
    complete &= size > 0
    return np.asarray(values[:, complete] / size[complete, None], np.complex128)


def _meets_phase_criteria(fitted: ModalFit, criteria: ModeCriteria) -> Mask:
    """Return which modes meet the limits of MPC and MPD; (n_mode,).

    The others stay in the fit, like poles beside the band. Without them their neighbours would fit
    their part of the response, and would become complex too.
    """
    accepted: Mask = mpc(fitted.shapes) >= criteria.collinearity
    accepted &= mpd(fitted.shapes) <= criteria.phase_deviation
    return accepted


def _transpose_data(data: WeightedFrfs) -> WeightedFrfs:
    """Exchange outputs and inputs: with a roving hammer the few fixed sensors are references."""
    return replace(
        data,
        values=data.values.transpose(0, 2, 1),
        weights=data.weights.transpose(0, 2, 1),
        cells=data.cells.T,
    )


def _transpose_fit(fit: ModalFit) -> ModalFit:
    """Exchange outputs and inputs of a fit."""
    return replace(
        fit,
        participation=fit.shapes,
        shapes=fit.participation,
        lower=fit.lower.T,
        upper=fit.upper.T,
    )


def _reduced_cost(data: WeightedFrfs, fitted: ModalFit, n_pole_parameters: int) -> float:
    """Return the cost per degree of freedom.

    A complex value has two real numbers, of which each parameter takes one.

    Args:
        fitted: fit with its cost.
        n_pole_parameters: number of real parameters of poles and participation.
    """
    cells = int((data.cells > 0).sum())
    n_out, n_in = data.cells.shape
    n_parameters = n_pole_parameters + n_out * (2 * len(fitted.poles) + 2 * n_in)
    return float(
        fitted.cost * data.correlated_lines / max(cells * len(data.laplace) - n_parameters / 2, 1.0)
    )


def _standard_deviations(fitted: ModalFit, matrix: Real, fixed: Mask) -> tuple[Real, Real]:
    """Return standard deviations of frequency [Hz] and damping ratio; (n_mode,) each.

    cov(Re s, Im s) is half the inverse of the normal matrix. |s| and -Re s / |s| follow to first
    order. Errors of the model itself are not included.
    """
    sds = np.zeros((2, len(fixed)))
    count = int((~fixed).sum())
    if not count:
        return sds[0], sds[1]
    size = np.sqrt(np.maximum(np.diag(matrix), _EIGENVALUE_FLOOR * np.diag(matrix).max()))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    # Poles far beside the band, as of a free axis, are nearly collinear with the residuals:
    # rounding must not give negative variances, nor mix such a direction into other modes.
    floor = _EIGENVALUE_FLOOR * values[-1]
    is_rounding = (values < floor) & (np.abs(vectors) < _MIN_COMPONENT)
    scaled = np.where(is_rounding, 0.0, vectors) / size[:, None]
    covariance = scaled / np.maximum(values, floor) @ scaled.T / 2
    place = np.arange(count)
    poles = fitted.poles[~fixed]
    real, imag, size = poles.real, poles.imag, np.abs(poles)
    var_r, var_i = covariance[place, place], covariance[count + place, count + place]
    covariance_ri = covariance[place, count + place]
    frequency = (real**2 * var_r + imag**2 * var_i + 2 * real * imag * covariance_ri) / size**2
    slope_r, slope_i = -(imag**2) / size**3, real * imag / size**3
    damping = slope_r**2 * var_r + slope_i**2 * var_i + 2 * slope_r * slope_i * covariance_ri
    sds[:, ~fixed] = np.sqrt(frequency) / (2 * np.pi), np.sqrt(damping)
    return sds[0], sds[1]
