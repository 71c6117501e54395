"""From clusters of poles to all modes: the remainder is searched, what noise explains dropped.

A mode that the polynomials missed shows as a peak of the weighted remainder; it stays if it lowers
the cost by several times what noise would. Modes beside the band are searched too, since the real
residuals of LSFD cannot hold those that lie next to it: without them the modes at the ends of the
band are biased by more than their standard deviations.
"""

import numpy as np

from identification.modal.indicators import mac
from identification.modal.pole_clusters import Tolerances
from identification.modal.refinement import (
    Data,
    ModalFit,
    contradiction,
    cost_without,
    fit_shapes,
    refine,
    weighted_error,
)
from identification.words import Complex, Mask, Real

_ADDED, _GUARDS = 12, 6  # poles searched in what is left and beside the band, at most
_NOISE = 3.0  # times the number of its parameters that a mode must lower the cost
_GUARD = 0.7  # the same of a pole beside the band; noise alone gives 0.5
_ALONE = 0.3  # of the drop that is asked for, which the new pole must give while others stay
_SOON = 3.0  # times as rough it may be until then
_ALIKE = 0.999  # modal assurance criterion of what the halves of a split mode share
_NARROW = 0.002  # of the band: where a pole was refused, none is searched again in these lines
_REFUSED = 3  # poles refused before the search ends: the highest peak may be a few cells' noise
_ROUGH = 0.05  # of the former, at which a search on the way has settled
_REACH = 5.0  # times the end of the band: further away a pole is a constant
_FIRST = 10  # steps before the search: while many modes are missing, the fit creeps
_ABOVE, _BELOW = (1.04, 1.15, 1.4, 2.0), (0.9, 0.6)  # where guards start, of the band's ends


def completed(
    data: Data,
    freq_hz: Real,
    poles: Complex,
    participation: Complex,
    tolerances: Tolerances,
) -> tuple[ModalFit, Real]:
    """Refine, add what the remainder shows, drop what noise could explain."""
    found, _ = refine(data, poles, participation, settled=_rough(data), steps=_FIRST)
    found = _with_more(data, freq_hz, found, inside=True)
    found = _with_more(data, freq_hz, found, inside=False)
    while (worst := _superfluous(data, freq_hz, found, tolerances)) is not None:
        found = rough_fit(data, *_without(found, worst))
    found, matrix = refine(data, found.poles, found.participation)
    while (worst := _superfluous(data, freq_hz, found, tolerances)) is not None:
        found, matrix = refine(data, *_without(found, worst))
    return found, matrix


def _superfluous(data: Data, freq_hz: Real, found: ModalFit, tolerances: Tolerances) -> int | None:
    """The pole that explains least, if that is no more than noise would, or if it is no mode.

    One at a time: of two poles that stand for one another either may go, not both.
    """
    if not len(found.poles):
        return None
    inside = inside_band(found, freq_hz)
    worth = cost_without(data, found) / np.where(inside, _NOISE, _GUARD)
    worth /= _contradictions(data, freq_hz, found)
    worth[inside & ~_physical(found, tolerances)] = 0.0
    worth[_remote(found, freq_hz)] = 0.0
    weaker = splits(found) & (worth[:, None] <= worth)
    worth[inside & weaker.any(axis=1)] = 0.0
    worst = int(np.argmin(worth))
    return worst if worth[worst] <= _parameters(data) else None


def _without(found: ModalFit, worst: int) -> tuple[Complex, Complex]:
    keep = np.arange(len(found.poles)) != worst
    return found.poles[keep], found.participation[:, keep]


def rough_fit(data: Data, poles: Complex, participation: Complex) -> ModalFit:
    """A fit on the way, which stops where noise begins."""
    fitted, _ = refine(data, poles, participation, settled=_rough(data))
    return fitted


def _rough(data: Data) -> float:
    return _ROUGH * _NOISE * _parameters(data)


def _with_more(data: Data, freq_hz: Real, found: ModalFit, *, inside: bool) -> ModalFit:
    """Add poles while they lower the cost by more than noise would, inside the band or beside it.

    A pole beside the band stands for all modes there, which matter most to the modes next to
    them; it need be neither a mode nor damped, so that less has to speak for it.
    """
    threshold = (_NOISE if inside else _GUARD) * _parameters(data)
    refused, passed = np.zeros(len(freq_hz), bool), 0
    for _ in range(_ADDED if inside else _GUARDS):
        error = weighted_error(data, found) * ~refused[:, None, None]
        starts = [_peak(freq_hz, error, found)] if inside else _beside(data, freq_hz, error, found)
        more = [_with(data, found, pole, row) for pole, row in starts]
        if not inside:  # those that stayed there
            most = (~inside_band(found, freq_hz)).sum()
            more = [
                fit
                for fit in more
                if (~inside_band(fit, freq_hz)).sum() > most and not _remote(fit, freq_hz)[-1]
            ]
        better = min(more, key=lambda fit: fit.cost, default=found)
        split = inside and better is not found and bool(splits(better)[-1].any())
        if not split and found.cost - better.cost > _ALONE * threshold:
            better = rough_fit(data, better.poles, better.participation)
            drop = threshold * _contradictions(data, freq_hz, better)[-1]
            if found.cost - better.cost >= drop:
                found = better
                continue
        passed += not split
        if not inside or passed > _REFUSED:
            break
        width = max(2 * abs(better.damping[-1]), _NARROW) * freq_hz[-1]
        refused |= np.abs(freq_hz - starts[0][0].imag / (2 * np.pi)) <= width
    return found


def _with(data: Data, found: ModalFit, pole: complex, row: Complex) -> ModalFit:
    """One pole more, moved until it settles while the others stay where they are."""
    poles, rows = np.append(found.poles, pole), np.column_stack([found.participation, row])
    only = np.arange(len(poles)) == len(found.poles)
    fitted, _ = refine(data, poles, rows, settled=_SOON * _rough(data), only=only)
    return fitted


def splits(fitted: ModalFit) -> Mask:
    """Which pairs of poles are one mode, split; (n_mode, n_mode).

    Where FRFs of one machine contradict one another, since it warms up between hits or sensors
    load it, two poles fit one resonance better than one: H_o = phi_o l / (s - s_r - d_o) is about
    phi_o l / (s - s_r) + d_o phi_o l / (s - s_r)^2. They share their participation (or their
    shape, where the contradiction is between hits) to 1e-3, which two modes nearly never do.
    """
    poles = fitted.poles
    alike = np.zeros((len(poles), len(poles)), bool)
    for vectors in (fitted.participation, fitted.shapes):
        if len(vectors) > 1:
            alike |= mac(vectors, vectors) > _ALIKE
    reach = np.abs(poles.real)
    alike &= np.abs(poles[:, None] - poles) < reach[:, None] + reach
    np.fill_diagonal(alike, val=False)
    return alike


def _contradictions(data: Data, freq_hz: Real, fitted: ModalFit) -> Real:
    """Squared remainder over variance near each mode, 1 at least; (n_mode,).

    Where the FRFs of a resonance contradict one another, so much more than noise must speak for
    one mode more there. For a pole beside the band all lines count.
    """
    cells = int((data.cells > 0).sum())
    left = (np.abs(weighted_error(data, fitted)) ** 2).sum(axis=(1, 2)) * data.alike / cells
    found = np.full(len(fitted.poles), contradiction(data, fitted))
    for mode in np.flatnonzero(inside_band(fitted, freq_hz)):
        away = np.abs(freq_hz - fitted.freq_hz[mode])
        near = away <= 2 * abs(fitted.damping[mode]) * fitted.freq_hz[mode]
        near |= away <= np.partition(away, 4)[4]
        found[mode] = max(1.0, left[near].mean())
    return found


def _parameters(data: Data) -> int:
    """Real numbers that a mode takes."""
    n_out, n_in = data.cells.shape
    return int(2 + 2 * (n_in - 1) + 2 * n_out)


def inside_band(found: ModalFit, freq_hz: Real) -> Mask:
    """Which modes lie between the first line and the last; (n_mode,)."""
    inside: Mask = (found.freq_hz >= freq_hz[0]) & (found.freq_hz <= freq_hz[-1])
    return inside


def _remote(found: ModalFit, freq_hz: Real) -> Mask:
    """Poles so far beside the band that residuals are all they are; (n_mode,).

    They fit noise, and creep on for ever, since nothing tells how far away they lie.
    """
    remote: Mask = found.freq_hz > _REACH * freq_hz[-1]
    remote |= found.freq_hz < freq_hz[0] / _REACH
    return remote


def _peak(freq_hz: Real, error: Complex, found: ModalFit) -> tuple[complex, Complex]:
    """A pole where the weighted remainder is largest."""
    size = np.linalg.norm(error, ord=2, axis=(1, 2)) ** 2
    peak = int(np.argmax(np.convolve(size, np.ones(5) / 5, mode="same")))
    return start_at(freq_hz, freq_hz[peak], error, found)


def _beside(
    data: Data, freq_hz: Real, error: Complex, found: ModalFit
) -> list[tuple[complex, Complex]]:
    """One pole above and one below the band, for what the weighted remainder asks at its ends."""
    count = max(8, len(freq_hz) // 8)
    starts = []
    for places, part in (
        (freq_hz[-1] * np.array(_ABOVE), error[-count:]),
        (freq_hz[0] * np.array(_BELOW), error[:count]),
    ):
        flat = part.reshape(-1, error.shape[2])
        most = np.linalg.eigh((flat.conj().T @ flat).real)[1][:, -1] + 0j
        rows = np.column_stack([found.participation, most])
        poles = [_pole(place, found) for place in places]
        costs = [fit_shapes(data, np.append(found.poles, pole), rows).cost for pole in poles]
        starts.append((poles[int(np.argmin(costs))], most))
    return starts


def start_at(
    freq_hz: Real, place: float, error: Complex, found: ModalFit
) -> tuple[complex, Complex]:
    """A pole at a frequency [Hz], with the participation that the weighted remainder has there."""
    line = int(np.abs(freq_hz - place).argmin())
    rows = np.linalg.svd(error[max(0, line - 2) : line + 3].reshape(-1, error.shape[2]))[2]
    return _pole(place, found), rows[0]


def _pole(place: float, found: ModalFit) -> complex:
    """At a frequency [Hz], damped as the others are."""
    damping = float(np.clip(np.median(found.damping), 1e-4, 0.1)) if len(found.poles) else 0.01
    return complex(2 * np.pi * place * (-damping + 1j * np.sqrt(1 - damping**2)))


def _physical(found: ModalFit, tolerances: Tolerances) -> Mask:
    physical: Mask = (found.damping > 0) & (found.damping < tolerances.highest_damping)
    return physical
