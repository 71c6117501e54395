"""Complete the modes of a fit: find modes in its residual, remove those that noise explains.

A mode that the polynomials missed shows as a peak of the weighted residual. It is added if it
lowers the cost by several times what noise would. Poles beside the band are searched too, since the
real residual terms of LSFD cannot describe modes next to the band. Without these poles the modes at
the ends of the band are biased by more than their standard deviations.
"""

import numpy as np

from identification.modal.indicators import mac
from identification.modal.pole_clusters import ModeCriteria
from identification.modal.refinement import refine
from identification.modal.shape_fit import (
    ModalFit,
    WeightedFrfs,
    cost_rise_without,
    fit_shapes,
    reduced_chi_square,
    weighted_error,
)
from identification.words import Complex, Mask, Real

# Poles that are added inside the band and beside it, at most; counts.
_MAX_ADDED_MODES, _MAX_GUARD_POLES = 12, 6
# Drop of the cost that an added mode must give, per parameter; noise alone gives 0.5.
_MIN_COST_DROP = 3.0
# Drop of the cost that a pole beside the band must give, per parameter: just above noise.
_MIN_GUARD_COST_DROP = 0.7
# Drop of the reduced chi-square by a pole so far from the band that its frequency is not seen: the
# drag of a free axis, whose receptance is 1 / (m s (s + d)).
_MIN_REMOTE_DROP = 0.5
# Share of the required drop that a new pole must give while all other poles stay fixed.
_MIN_SOLO_SHARE = 0.3
# Factor on the cost tolerance of a fit while all other poles stay fixed.
_SOLO_ROUGHNESS = 3.0
# MAC of the participation, or of the shapes, above which two overlapping poles are one mode.
_MIN_SPLIT_MAC = 0.999
# Half-width around a refused pole in which none is searched again, relative to the band's end.
_REFUSED_BAND_SHARE = 0.002
# Poles refused before the search ends: the highest peak may be the noise of a few cells.
_MAX_REFUSALS = 3
# Cost tolerance of an intermediate fit, relative to the required drop of a mode.
_ROUGH_COST_SHARE = 0.05
# Frequency of a pole over the band's end beyond which it acts as a constant in the band.
_MAX_BAND_DISTANCE = 5.0
# Steps of the fit before the search: it converges slowly while many modes are missing.
_FIRST_STEPS = 10
# Start frequencies of poles beside the band, relative to its last and its first line.
_GUARD_STARTS_ABOVE, _GUARD_STARTS_BELOW = (1.04, 1.15, 1.4, 2.0), (0.9, 0.6)


def add_missing_modes(
    data: WeightedFrfs,
    freq_hz: Real,
    poles: Complex,
    participation: Complex,
    criteria: ModeCriteria,
    *,
    n_growing: int = 0,
) -> tuple[ModalFit, Real]:
    """Refine the fit, add the modes that its residual shows, remove those that noise explains.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        poles: start values [rad/s]; (n_mode,).
        participation: start values; (n_in, n_mode).
        criteria: which modes are physical.
        n_growing: number of start values, the last ones, that may have negative damping.

    Returns:
        The fit, and its normal matrix as ``refine`` gives it.
    """
    growing = poles[len(poles) - n_growing :]
    fitted, _ = refine(
        data, poles, participation, cost_tolerance=_rough_cost_drop(data), max_steps=_FIRST_STEPS
    )
    fitted = _add_poles(data, freq_hz, fitted, inside=True)
    fitted = _add_poles(data, freq_hz, fitted, inside=False)
    while (worst := _find_superfluous(data, freq_hz, fitted, criteria, growing)) is not None:
        fitted = fit_roughly(data, *_remove_pole(fitted, worst))
    fitted, matrix = refine(data, fitted.poles, fitted.participation)
    while (worst := _find_superfluous(data, freq_hz, fitted, criteria, growing)) is not None:
        fitted, matrix = refine(data, *_remove_pole(fitted, worst))
    return fitted, matrix


def _find_superfluous(
    data: WeightedFrfs,
    freq_hz: Real,
    fitted: ModalFit,
    criteria: ModeCriteria,
    growing: Complex,
) -> int | None:
    """Return the pole that explains least, if noise explains as much or it is no mode; else None.

    Only one pole is removed at a time: of two poles that can replace each other, one must stay.
    """
    if not len(fitted.poles):
        return None
    inside = is_inside_band(fitted, freq_hz)
    rise = cost_rise_without(data, fitted)
    relative_rise = rise / np.where(inside, _MIN_COST_DROP, _MIN_GUARD_COST_DROP)
    relative_rise /= _local_chi_squares(data, freq_hz, fitted)
    relative_rise[inside & ~_is_physical(fitted, criteria, growing)] = 0.0
    relative_rise[_is_remote(fitted, freq_hz) & (rise < _large_cost_drop(data))] = 0.0
    weaker = find_split_modes(fitted) & (relative_rise[:, None] <= relative_rise)
    relative_rise[inside & weaker.any(axis=1)] = 0.0
    worst = int(np.argmin(relative_rise))
    return worst if relative_rise[worst] <= _count_parameters(data) else None


def _remove_pole(fitted: ModalFit, pole: int) -> tuple[Complex, Complex]:
    """Return poles and participation without one pole."""
    keep = np.arange(len(fitted.poles)) != pole
    return fitted.poles[keep], fitted.participation[:, keep]


def fit_roughly(data: WeightedFrfs, poles: Complex, participation: Complex) -> ModalFit:
    """Refine a fit only until its cost changes by less than noise does."""
    fitted, _ = refine(data, poles, participation, cost_tolerance=_rough_cost_drop(data))
    return fitted


def _rough_cost_drop(data: WeightedFrfs) -> float:
    """Return the cost tolerance of an intermediate fit."""
    return _ROUGH_COST_SHARE * _MIN_COST_DROP * _count_parameters(data)


def _large_cost_drop(data: WeightedFrfs) -> float:
    """Return the drop of the cost that takes ``_MIN_REMOTE_DROP`` off the reduced chi-square."""
    count = int((data.cells > 0).sum()) * len(data.laplace)
    return _MIN_REMOTE_DROP * count / data.correlated_lines


def _add_poles(data: WeightedFrfs, freq_hz: Real, fitted: ModalFit, *, inside: bool) -> ModalFit:
    """Add poles inside the band or beside it while they lower the cost by more than noise would.

    A pole beside the band stands for all modes there, which affect the modes next to them most. It
    need be neither a mode nor damped, so that a smaller drop of the cost suffices.
    """
    threshold = (_MIN_COST_DROP if inside else _MIN_GUARD_COST_DROP) * _count_parameters(data)
    refused, n_refused = np.zeros(len(freq_hz), bool), 0
    for _ in range(_MAX_ADDED_MODES if inside else _MAX_GUARD_POLES):
        error = weighted_error(data, fitted) * ~refused[:, None, None]
        starts = (
            [_start_at_peak(freq_hz, error, fitted)]
            if inside
            else _start_beside_band(data, freq_hz, error, fitted)
        )
        candidates = [_add_pole(data, fitted, pole, row) for pole, row in starts]
        if not inside:  # keep the candidates whose pole has stayed beside the band
            n_outside = (~is_inside_band(fitted, freq_hz)).sum()
            candidates = [
                fit
                for fit in candidates
                if (~is_inside_band(fit, freq_hz)).sum() > n_outside
                and (
                    not _is_remote(fit, freq_hz)[-1]
                    or fitted.cost - fit.cost > _large_cost_drop(data)
                )
            ]
        best = min(candidates, key=lambda fit: fit.cost, default=fitted)
        is_split = inside and best is not fitted and bool(find_split_modes(best)[-1].any())
        if not is_split and fitted.cost - best.cost > _MIN_SOLO_SHARE * threshold:
            best = fit_roughly(data, best.poles, best.participation)
            drop = threshold * _local_chi_squares(data, freq_hz, best)[-1]
            if fitted.cost - best.cost >= drop:
                fitted = best
                continue
        n_refused += not is_split
        if not inside or n_refused > _MAX_REFUSALS:
            break
        width = max(2 * abs(best.damping[-1]), _REFUSED_BAND_SHARE) * freq_hz[-1]
        refused |= np.abs(freq_hz - starts[0][0].imag / (2 * np.pi)) <= width
    return fitted


def _add_pole(data: WeightedFrfs, fitted: ModalFit, pole: complex, row: Complex) -> ModalFit:
    """Add one pole and fit it while all other poles stay fixed."""
    poles, rows = np.append(fitted.poles, pole), np.column_stack([fitted.participation, row])
    is_new = np.arange(len(poles)) == len(fitted.poles)
    moved, _ = refine(
        data,
        poles,
        rows,
        cost_tolerance=_SOLO_ROUGHNESS * _rough_cost_drop(data),
        free_modes=is_new,
    )
    return moved


def find_split_modes(fitted: ModalFit) -> Mask:
    """Return which pairs of poles describe one mode that the fit has split; (n_mode, n_mode).

    FRFs of one machine contradict each other when it warms up between hits or when sensors load it.
    Two poles then fit one resonance better than one pole: H_o = phi_o l / (s - s_r - d_o) is about
    phi_o l / (s - s_r) + d_o phi_o l / (s - s_r)^2. The two poles share their participation to
    1e-3, or their shape if the contradiction is between hits. Two separate modes hardly ever do.
    """
    poles = fitted.poles
    is_split = np.zeros((len(poles), len(poles)), bool)
    for vectors in (fitted.participation, fitted.shapes):
        if len(vectors) > 1:
            is_split |= mac(vectors, vectors) > _MIN_SPLIT_MAC
    half_width = np.abs(poles.real)
    is_split &= np.abs(poles[:, None] - poles) < half_width[:, None] + half_width
    np.fill_diagonal(is_split, val=False)
    return is_split


def _local_chi_squares(data: WeightedFrfs, freq_hz: Real, fitted: ModalFit) -> Real:
    """Return the squared residual over variance near each mode, at least 1; (n_mode,).

    Where the FRFs of a resonance contradict each other, the drop of the cost that an additional
    mode must give is larger by this factor. For a pole beside the band all lines count.
    """
    cells = int((data.cells > 0).sum())
    squared_error = (
        (np.abs(weighted_error(data, fitted)) ** 2).sum(axis=(1, 2)) * data.correlated_lines / cells
    )
    chi_squares = np.full(len(fitted.poles), reduced_chi_square(data, fitted))
    for mode in np.flatnonzero(is_inside_band(fitted, freq_hz)):
        distance = np.abs(freq_hz - fitted.freq_hz[mode])
        near = distance <= 2 * abs(fitted.damping[mode]) * fitted.freq_hz[mode]
        near |= distance <= np.partition(distance, 4)[4]
        chi_squares[mode] = max(1.0, squared_error[near].mean())
    return chi_squares


def _count_parameters(data: WeightedFrfs) -> int:
    """Return the number of real parameters of a mode."""
    n_out, n_in = data.cells.shape
    return int(2 + 2 * (n_in - 1) + 2 * n_out)


def is_inside_band(fitted: ModalFit, freq_hz: Real) -> Mask:
    """Return which modes lie between the first line and the last; (n_mode,)."""
    return (fitted.freq_hz >= freq_hz[0]) & (fitted.freq_hz <= freq_hz[-1])


def _is_remote(fitted: ModalFit, freq_hz: Real) -> Mask:
    """Return which poles lie so far from the band that they act as residual terms; (n_mode,).

    Such poles fit noise. Their frequency is not identifiable, so that the fit never converges.
    """
    remote: Mask = fitted.freq_hz > _MAX_BAND_DISTANCE * freq_hz[-1]
    remote |= fitted.freq_hz < freq_hz[0] / _MAX_BAND_DISTANCE
    return remote


def _start_at_peak(freq_hz: Real, error: Complex, fitted: ModalFit) -> tuple[complex, Complex]:
    """Return the start of a pole at the largest weighted residual: pole and participation."""
    size = np.linalg.norm(error, ord=2, axis=(1, 2)) ** 2
    peak = int(np.argmax(np.convolve(size, np.ones(5) / 5, mode="same")))
    return start_pole_at(freq_hz, freq_hz[peak], error, fitted)


def _start_beside_band(
    data: WeightedFrfs, freq_hz: Real, error: Complex, fitted: ModalFit
) -> list[tuple[complex, Complex]]:
    """Return the start of a pole above and of one below the band, from the residual at its ends."""
    count = max(8, len(freq_hz) // 8)
    starts = []
    for places, part in (
        (freq_hz[-1] * np.array(_GUARD_STARTS_ABOVE), error[-count:]),
        (freq_hz[0] * np.array(_GUARD_STARTS_BELOW), error[:count]),
    ):
        flat = part.reshape(-1, error.shape[2])
        strongest = np.linalg.eigh((flat.conj().T @ flat).real)[1][:, -1] + 0j
        rows = np.column_stack([fitted.participation, strongest])
        poles = [_pole_at(place, fitted) for place in places]
        costs = [fit_shapes(data, np.append(fitted.poles, pole), rows).cost for pole in poles]
        starts.append((poles[int(np.argmin(costs))], strongest))
    return starts


def start_pole_at(
    freq_hz: Real, frequency: float, error: Complex, fitted: ModalFit
) -> tuple[complex, Complex]:
    """Return the start of a pole at a frequency [Hz], with the participation of the residual."""
    line = int(np.abs(freq_hz - frequency).argmin())
    rows = np.linalg.svd(error[max(0, line - 2) : line + 3].reshape(-1, error.shape[2]))[2]
    return _pole_at(frequency, fitted), rows[0]


def _pole_at(frequency: float, fitted: ModalFit) -> complex:
    """Return a pole at a frequency [Hz] with the median damping of the other poles."""
    damping = float(np.clip(np.median(fitted.damping), 1e-4, 0.1)) if len(fitted.poles) else 0.01
    return complex(2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2)))


def _is_physical(fitted: ModalFit, criteria: ModeCriteria, growing: Complex) -> Mask:
    """Return which modes have a damping ratio from zero to the highest allowed; (n_mode,).

    Those of ``growing`` poles may be negative, at no more than their half-width from them.
    """
    physical: Mask = (fitted.damping > 0) & (fitted.damping < criteria.highest_damping)
    distance = np.abs(fitted.poles[:, None] - growing)
    is_growing = (distance < np.abs(growing.real)).any(axis=1)
    return physical | (is_growing & (fitted.damping < 0))
